"""From an OpenSim model of an arm to polynomials: `rosrun hric_human fit_muscles`.

    anatomy = delft.fit(Path("das4_v4.osim"))

`delft` is the built-in model, mended and with a shoulder girdle that follows the arm.
"""
