"""Fit of muscle polynomials to a musculoskeletal model of an arm; used by `hric fit_muscles` and `muscles.choose`.

    anatomy = models.fit(Path("arm26.osim"))

`delft` fits the built-in model, repaired and with a shoulder girdle that follows the arm; `any_arm` fits other models
unchanged, read by `opensim_model` and `mujoco_model`.
"""
