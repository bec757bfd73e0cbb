from .writing import MovieError as MovieError
from .writing import write_movie as write_movie
