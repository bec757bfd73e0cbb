"""What flies: airframe, actuators and their faults, disturbances, sensors, the vehicle process. Imports only `link`."""
