"""What would be on board: flight-path variables, elements, schemes, the autopilot process. Imports only `link`."""
