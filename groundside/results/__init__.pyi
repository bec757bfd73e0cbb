from .exports import FORMATS as FORMATS
from .exports import export as export
from .folders import NothingRecordedError as NothingRecordedError
from .folders import RunError as RunError
from .folders import new_folder as new_folder
from .folders import sole_writer as sole_writer
from .run import Run as Run
from .table import TableWriter as TableWriter
