"""From a model of an arm to polynomials: `rosrun hric_human fit_muscles`, and `hric_human.muscles.choose`.

    anatomy = models.fit(Path("arm26.osim"))

`delft` is the built-in model, mended and with a shoulder girdle that follows the arm; `any_arm` takes others as they
are, by what `opensim_model` and `mujoco_model` read.
"""
