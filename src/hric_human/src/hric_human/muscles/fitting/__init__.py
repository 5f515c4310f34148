"""Fit of polynomials to a model of an arm: `hric fit_muscles`, and `hric_human.muscles.choose`.

    anatomy = models.fit(Path("arm26.osim"))

`delft` is the built-in model, repaired and with a shoulder girdle that follows the arm; `any_arm` takes other models
unchanged, read by `opensim_model` and `mujoco_model`.
"""
