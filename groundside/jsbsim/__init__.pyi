from .actuators import STANDARD_TRAVEL as STANDARD_TRAVEL
from .actuators import Actuator as Actuator
from .actuators import ActuatorError as ActuatorError
from .actuators import actuators_of as actuators_of
from .writing import AircraftError as AircraftError
from .writing import can_fly_level as can_fly_level
from .writing import write_aircraft as write_aircraft
