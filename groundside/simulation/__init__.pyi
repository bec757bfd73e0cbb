from .cases import cases_of as cases_of
from .cases import claims_in_flight as claims_in_flight
from .cases import load_case as load_case
from .flight import Flight as Flight
from .one_process import PlainPython as PlainPython
from .one_process import fly_in_memory as fly_in_memory
from .space import TooLargeError as TooLargeError
from .to_disk import simulate as simulate
