"""Reads the files of `roost run --frames` with VTK's own reader, which is ParaView's, and holds them to docs/frames.md.

    read.py FRAMES [OTHER]      with OTHER, a folder of the same run, also compares every array, bit by bit
"""

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkCommand
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

POINTS = {
    "speed_m_s": ("float32", 1), "velocity_m_s": ("float32", 3), "spin_rad_s": ("float32", 3), "body": ("uint32", 1),
    "shape": ("uint32", 1), "radius_m": ("float32", 1), "bonds_broken": ("uint32", 1),
}
SURFACES = {"surface": ("uint32", 1), "velocity_m_s": ("float32", 3)}


def read(path):
    """All that VTK finds in a file; whatever it complains of ends the program."""
    complaints = []
    reader = vtkXMLPolyDataReader()
    for kind in (vtkCommand.ErrorEvent, vtkCommand.WarningEvent):
        reader.AddObserver(kind, lambda *_: complaints.append(path))
    reader.SetFileName(str(path))
    reader.Update()
    assert not complaints and reader.GetErrorCode() == 0, complaints
    data = reader.GetOutput()

    def arrays(carried):
        found = (carried.GetArray(index) for index in range(carried.GetNumberOfArrays()))
        return {array.GetName(): vtk_to_numpy(array) for array in found}

    def corners(cells):
        return vtk_to_numpy(cells.GetConnectivityArray()), vtk_to_numpy(cells.GetOffsetsArray())

    points = vtk_to_numpy(data.GetPoints().GetData()) if data.GetNumberOfPoints() else np.zeros((0, 3), np.float32)
    chief = [data.GetPointData().GetScalars(), data.GetCellData().GetScalars(), data.GetPointData().GetVectors()]
    return {
        "points": points,
        "of_points": arrays(data.GetPointData()),
        "of_cells": arrays(data.GetCellData()),
        "lines": corners(data.GetLines()),
        "polygons": corners(data.GetPolys()),
        "chief": [array and array.GetName() for array in chief],
    }


def hold(arrays, table, count):
    assert arrays.keys() == table.keys(), arrays.keys()
    for name, (kind, components) in table.items():
        assert arrays[name].dtype == kind, (name, arrays[name].dtype)
        assert arrays[name].shape == ((count,) if components == 1 else (count, components)), (name, arrays[name].shape)


def particles(path):
    file = read(path)
    points, carried = file["points"], file["of_points"]
    hold(carried, POINTS, len(points))
    speeds = np.linalg.norm(carried["velocity_m_s"].astype(float), axis=1)
    assert np.allclose(carried["speed_m_s"], speeds, rtol=1e-5, atol=1e-9)
    corners, offsets = file["lines"]
    ends = corners.reshape(-1, 2)
    assert np.array_equal(offsets, np.arange(0, len(corners) + 1, 2))
    hold(file["of_cells"], {"stretch": ("float32", 1)}, len(ends))
    if len(ends):
        lengths = np.linalg.norm(points[ends[:, 0]].astype(float) - points[ends[:, 1]], axis=1)
        assert np.allclose(lengths / (2 * carried["radius_m"][0]), file["of_cells"]["stretch"], atol=1e-4)
        assert file["chief"] == ["speed_m_s", "stretch", "velocity_m_s"], file["chief"]
    return file, len(points), len(ends)


def surfaces(path):
    file = read(path)
    corners, offsets = file["polygons"]
    assert np.array_equal(offsets, np.arange(0, len(corners) + 1, 3))
    assert len(file["points"]) == len(corners)
    hold(file["of_cells"], SURFACES, len(corners) // 3)
    return file, 0, len(corners) // 3


def same(one, other):
    assert other.keys() <= one.keys()
    for name in one:
        # A frame without bonds may go without their array.
        if name not in other and not len(one[name]):
            continue
        if isinstance(one[name], dict):
            same(one[name], other[name])
        elif name in ("lines", "polygons"):
            assert all(np.array_equal(a, b) for a, b in zip(one[name], other[name], strict=True)), name
        elif isinstance(one[name], np.ndarray):
            assert one[name].dtype == other[name].dtype and one[name].tobytes() == other[name].tobytes(), name
        elif len(one["points"]):
            assert one[name] == other[name], name


def main(folder, other=None):
    folder, counts = Path(folder), [0, 0, 0]
    entries = ElementTree.parse(folder / "frames.pvd").findall("./Collection/DataSet")
    names = sorted({entry.get("file") for entry in entries})
    assert names == sorted(f"vtk/{path.name}" for path in (folder / "vtk").glob("*.vtp"))
    for name in names:
        file, points, cells = (particles if "particles" in name else surfaces)(folder / name)
        counts = [sum(pair) for pair in zip(counts, (1, points, cells))]
        if other:
            same(file, read(Path(other) / name))
    files, points, cells = counts
    print(f"{files} files, {points} points, {cells} cells" + (", the same in both folders" if other else ""))


main(*sys.argv[1:])
