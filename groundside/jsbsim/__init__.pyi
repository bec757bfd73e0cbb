from .actuators import STANDARD_TRAVEL as STANDARD_TRAVEL
from .actuators import Actuator as Actuator
from .actuators import actuators_of as actuators_of
from .writing import AircraftError as AircraftError
from .writing import write_aircraft as write_aircraft
