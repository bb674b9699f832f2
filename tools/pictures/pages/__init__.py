"""The pictures of the pages and examples, one file per page. Importing this package registers them."""

from . import (  # noqa: F401
    adaptive,
    arms,
    collisions,
    elastic,
    examples,
    fit,
    friction,
    gradients,
    identification,
    impedance,
    inequalities,
    integration,
    minimum_time,
    priority,
    readme,
    time_path,
    worst_case,
)
