from .cases import cases_of as cases_of
from .cases import claims_in_flight as claims_in_flight
from .cases import load_case as load_case
from .one_process import Flight as Flight
from .one_process import PlainPython as PlainPython
from .one_process import TooLargeError as TooLargeError
from .one_process import fly_in_memory as fly_in_memory
from .one_process import simulate as simulate
