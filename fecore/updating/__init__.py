"""Finite element model updating in two stages: elastic constants from modes, then damping from
FRFs.

In the order of the data:

- `measurement`: what was measured and how it is to be used, made ready for updating.
- `parameters`: the parameters with their priors, and what temperature does to them.
- `mesh`: a mesh for a specimen and a band; what the mesh of a body in space misses.
- `state`: a model solved at one θ, with its derivatives; errors of shapes, and mixing of close modes.
- `forward`: the model at the measured points, and which measured mode is which of its modes.
- `inputs`: what a laboratory knows of its inputs, and what those do that are believed to be nothing.
- `posterior`: the linear problem about an estimate, its posterior, and which modes are real.
- `layout`: which unknowns a fit has, and how each campaign sees them.

Stage 1, elastic constants:

- `elastic`: `fit_elastic`, from one start.
- `elastic_starts`: from several starts, where one may end with modes paired wrongly; where to
  start without modes.
- `other_optima`: other constants that meet the same frequencies.
- `elastic_result`: what it gives, with its uncertainty by source.
- `damage`, `damage_effects`: where the stiffness of a body has changed.

Stage 2, damping:

- `damping_data`: FRFs and elastic model, and whether they belong together.
- `misfit`: of complex FRFs, with the noise that its residual shows.
- `laws`: what measured damping ratios are worth, and which law they support.
- `frf_fits`: a law from FRFs; or constants and damping in turn, where modes cannot be identified.
- `damping_stage`: `fit_reference` and `fit_damping`, with the uncertainty by source.
- `sampling`: both stages' posterior by Monte Carlo; predictions of what the fits did not see.

Effects that nobody stated, and sources that contradict each other:

- `additions`: masses, feet and soft supports as terms of the model, and whether frequencies show them.
- `suspects`: what may be added to a body, and where.
- `explanations`: fits with additions, compared by evidence.
- `contradictions`: each source against what all the others say of it.

Findings and results:

- `known_findings`: all that a user may have to know of a result, one table.
- `elastic_findings`: what looks wrong with an elastic update.
- `estimates`: estimates with standard deviation, interval and budget.
- `result`: what an update returns; verdict and warnings.
- `summary`: from the stages to the result.
- `pipeline`: `update`, the entry point.
- `campaigns`: several campaigns of one material together; constants over temperature.
- `plans`: what a test that nobody has made yet would add.
- `forecasts`: a model before anything is measured, and what would move its frequencies.
"""
