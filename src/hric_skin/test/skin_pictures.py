"""Make the pictures of the skin in docs/gallery.md: python3 src/hric_skin/test/skin_pictures.py.

The first shows nine postures, the second five subjects. It takes half a minute, and needs `scripts/setup --with
pictures`.
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image
from postures import POSTURES, SUBJECTS, person, transforms

from hric_core.geometry import FloatArray
from hric_skin import Skin, fitted
from urdf_to_osim.drawing.on_demand import install_vtk

DOCS = Path(__file__).parents[3] / "docs"
SIZE = (230, 300)
"""Width and height of one body [px]."""
SPAN, PITCH, YAW = 2.25, 12.0, 35.0
"""Height of the view [m], and direction of view, from above and from the front towards the person's left [deg]."""


def main() -> None:
    """Write both pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=DOCS, help="folder of the pictures (default: docs)")
    output = parser.parse_args().output
    install_vtk()
    man = person(*SUBJECTS[2])
    skin = fitted(man)
    postures = [draw(skin, skin.posed(transforms(man, angles))) for angles in POSTURES.values()]
    write(output / "skin_postures.png", [postures[:5], postures[5:]])
    bodies = [person(*subject) for subject in SUBJECTS]
    skins = [fitted(body) for body in bodies]
    relaxed = {"right_sh_abd": 8.0, "left_sh_abd": 8.0, "right_el_flex": 15.0, "left_el_flex": 15.0}
    poses = [transforms(body, relaxed) for body in bodies]
    write(
        output / "skin_subjects.png",
        [[draw(one, one.posed(T)) for one, T in zip(skins, poses, strict=True)]],
    )


def write(path: Path, rows: list[list[Image.Image]]) -> None:
    """Write pictures side by side in rows, with few colours; rows are centred."""
    width = SIZE[0] * max(map(len, rows))
    picture = Image.new("RGB", (width, SIZE[1] * len(rows)), "white")
    for row, images in enumerate(rows):
        for column, image in enumerate(images):
            picture.paste(image, ((width - SIZE[0] * len(images)) // 2 + SIZE[0] * column, SIZE[1] * row))
    picture.quantize(96).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


def draw(skin: Skin, vertices: FloatArray) -> Image.Image:
    """Return a picture of a skin, with its lowest point near the lower edge.

    Args:
        skin: skin of the person.
        vertices: its vertices at a posture, shape (n, 3) [m].
    """
    from vtkmodules import vtkRenderingCore as rendering
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
    from vtkmodules.vtkRenderingOpenGL2 import vtkEGLRenderWindow

    surface, points, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
    points.SetData(numpy_to_vtk(vertices, deep=True))
    cells.SetData(3, numpy_to_vtkIdTypeArray(skin.triangles.astype(np.int64).ravel(), deep=True))
    surface.SetPoints(points)
    surface.SetPolys(cells)
    rgb = np.round(255.0 * skin.colours).astype(np.uint8)
    surface.GetPointData().SetScalars(numpy_to_vtk(rgb, deep=True))
    smooth, mapper = vtkPolyDataNormals(splitting=False), rendering.vtkPolyDataMapper()
    smooth.SetInputData(surface)
    mapper.SetInputConnection(smooth.GetOutputPort())
    actor, renderer, window = rendering.vtkActor(), rendering.vtkRenderer(), vtkEGLRenderWindow()
    actor.SetMapper(mapper)
    actor.GetProperty().SetAmbient(0.25)
    actor.GetProperty().SetDiffuse(0.85)
    renderer.AddActor(actor)
    renderer.SetBackground(1.0, 1.0, 1.0)
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(*SIZE)
    window.AddRenderer(renderer)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    focus = 0.5 * (low + high)
    focus[2] = low[2] + 0.47 * SPAN
    pitch, yaw = np.radians((PITCH, YAW))
    towards = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(0.5 * SPAN)
    camera.SetFocalPoint(*focus)
    camera.SetPosition(*(focus + 5.0 * towards))
    camera.SetViewUp(0.0, 0.0, 1.0)
    renderer.ResetCameraClippingRange()
    window.Render()
    grab = rendering.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    image = grab.GetOutput()
    width, height, _ = image.GetDimensions()
    return Image.fromarray(vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)[::-1])


if __name__ == "__main__":
    main()
