"""Which effects a scene calls for at a tolerance, and what may be left out of it."""

from inverse.planning.options import everything
from inverse.planning.planner import plan
from inverse.planning.plans import Effect, Plan, PlannedFit

__all__ = ["Effect", "Plan", "PlannedFit", "everything", "plan"]
