from .graphs import KINDS as KINDS
from .graphs import RequestError as RequestError
from .making import Made as Made
from .making import make_scenario as make_scenario
from .request import MOST_UAVS as MOST_UAVS
from .request import Request as Request
