"""Which ways to compile one loop for several laws does numba keep on disk? ``python docs/closures.py`` tries six.

Each way runs in two processes, one after the other, with one cache, for the laws ``half`` and ``square``. Printed are
what the loop gives, whether the process loaded it or compiled it, how long the first call took, and a step's time.
`compiled.md` draws the conclusions.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

LAWS = """
import numba
@numba.njit("float64(float64)", cache=True)
def half(x):
    return 0.5 * x
@numba.njit("float64(float64)", cache=True)
def square(x):
    return x * x
"""

CLOSURE = """
def make_tick(step):
    @numba.njit(cache=True)
    def tick(x, n):
        for _ in range(n):
            x = step(x) + 1.0
        return x
    return tick, tick.stats
"""

KEPT_IDENTITY = (
    """
import uuid
for law in (laws.half, laws.square):
    law._set_uuid(str(uuid.uuid5(uuid.NAMESPACE_URL, law.__name__)))
"""
    + CLOSURE
)

ARGUMENT = """
@numba.njit(cache=True)
def loop(step, x, n):
    for _ in range(n):
        x = step(x) + 1.0
    return x
def make_tick(step):
    return (lambda x, n: loop(step, x, n)), loop.stats
"""

FUNCTION_TYPE = "step_type = numba.types.FunctionType(numba.float64(numba.float64))\n" + ARGUMENT.replace(
    "njit(", "njit(numba.float64(step_type, numba.float64, numba.int64), "
)

TEMPLATE = """
import numba
def tick(x, n):
    for _ in range(n):
        x = step(x) + 1.0
    return x
if named:
    tick.__qualname__ = f"{__name__}.tick"
tick = numba.njit(cache=True)(tick)
"""

INSTANCES = """
import importlib.util
def make_tick(step):
    name = f"template[{step.__name__}]"
    spec = importlib.util.spec_from_file_location(name, "template.py")
    module = importlib.util.module_from_spec(spec)
    module.__dict__.update(step=step, named=NAMED)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module.tick, module.tick.stats
ticks = {step: make_tick(step) for step in (laws.half, laws.square)}
make_tick = ticks.get
"""

USE = """
for step in (laws.half, laws.square):
    tick, stats = make_tick(step)
    begin = time.perf_counter()
    value = tick(1.0, 3)
    first = time.perf_counter() - begin
    begin = time.perf_counter()
    tick(0.5, 20_000_000)
    each = (time.perf_counter() - begin) / 2e7
    how = "compiled" if stats.cache_misses else "loaded"
    print(f"  {step.__name__:7} gives {value:6.3f}   {how:9} {first * 1e3:4.0f} ms   {each * 1e9:5.2f} ns a step")
"""

WAYS = {
    "a factory that returns a closure": CLOSURE,
    "the same, where the laws keep their identity from process to process": KEPT_IDENTITY,
    "the law as an argument": ARGUMENT,
    "the law as an argument of a function type": FUNCTION_TYPE,
    "a template": "NAMED = False" + INSTANCES,
    "a template whose functions have names of their own": "NAMED = True" + INSTANCES,
}


def main() -> None:
    """Try every way in two processes, in a folder that is removed."""
    for way, program in WAYS.items():
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            (place / "laws.py").write_text(LAWS)
            (place / "template.py").write_text(TEMPLATE)
            (place / "way.py").write_text(f"import sys, time\nimport numba, laws\n{program}{USE}")
            environment = os.environ | {"NUMBA_CACHE_DIR": str(place / "cache")}
            for n in (1, 2):
                print(f"{way}, process {n}", flush=True)
                subprocess.run([sys.executable, "way.py"], cwd=place, env=environment, check=True)


if __name__ == "__main__":
    main()
