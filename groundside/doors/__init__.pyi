from .flying import DoorOutcome as DoorOutcome
from .flying import fly_behind_doors as fly_behind_doors
from .preparing import DoorError as DoorError
from .preparing import field_of as field_of
from .preparing import followers_of as followers_of
from .preparing import set_aside as set_aside
from .programs import Px4Build as Px4Build
from .programs import find_px4 as find_px4
