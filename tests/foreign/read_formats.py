"""Reads the outputs of a run in a folder with numpy and meshio, and with VTK and Blender where
they are, and compares them with its tables: python3 read_formats.py FOLDER."""

import struct
import sys
import zipfile
from pathlib import Path

import numpy

folder = Path(sys.argv[1])


def table(name, n_columns):
    rows = (folder / name).read_text().splitlines()[1:]
    return numpy.array([[float(x or "nan") for x in row.split(",")[:n_columns]] for row in rows])


nodes = table("trajectory.csv", 8)
springs = table("springs.csv", 5)
n = int(nodes[:, 1].max()) + 1
k = int(springs[:, 1].max()) + 1
nodes = nodes.reshape(-1, n, 8)
springs = springs.reshape(-1, k, 5)
f = len(nodes)


def same(found, expected, what):
    assert found.shape == expected.shape, (what, found.shape, expected.shape)
    assert numpy.array_equal(found, expected, equal_nan=True), what


assert zipfile.ZipFile(folder / "trajectory.npz").testzip() is None
arrays = numpy.load(folder / "trajectory.npz")
assert sorted(arrays) == ["length", "position", "springs", "tension", "time", "velocity"]
same(arrays["time"], nodes[:, 0, 0], "time")
same(arrays["position"], nodes[:, :, 2:5], "position")
same(arrays["velocity"], nodes[:, :, 5:8], "velocity")
same(arrays["length"], springs[:, :, 2], "length")
same(arrays["tension"], springs[:, :, 4], "tension")
assert arrays["springs"].shape == (k, 2) and arrays["springs"].dtype == numpy.int64
print(f"numpy {numpy.__version__}: trajectory.npz, {f} frames")

import meshio
from xml.etree import ElementTree

entries = ElementTree.parse(folder / "frames.pvd").getroot().findall("Collection/DataSet")
assert len(entries) == f
for entry, rows, members in zip(entries, nodes, springs):
    assert float(entry.get("timestep")) == rows[0, 0]
    grid = meshio.read(folder / entry.get("file"))
    same(grid.points, rows[:, 2:5], "points")
    same(grid.point_data["velocity"], rows[:, 5:8], "velocity")
    same(grid.point_data["displacement"], rows[:, 2:5] - nodes[0, :, 2:5], "displacement")
    assert [cells.type for cells in grid.cells] == ["line"]
    same(grid.cells[0].data, arrays["springs"], "springs")
    same(grid.cell_data["strain"][0], members[:, 3], "strain")
    same(grid.cell_data["tension"][0], members[:, 4], "tension")
    same(grid.cell_data["state"][0], numpy.sign(members[:, 4]), "state")
print(f"meshio {meshio.__version__}: frames.pvd, {f} frames")

# By the bytes.
with open(folder / "points.pc2", "rb") as file:
    header = struct.unpack("<12siiffi", file.read(32))
    samples = numpy.fromfile(file, "<f4").reshape(-1, n, 3)
assert header == (b"POINTCACHE2\0", 1, n, 0.0, 1.0, f), header
same(samples, nodes[:, :, 2:5].astype("<f4"), "samples")
print(f"points.pc2, {f} samples")

try:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkVersion
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader
except ImportError:
    print("no VTK here: frames were not read with its own reader")
else:
    for entry, rows, members in zip(entries, nodes, springs):
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(folder / entry.get("file")))
        reader.Update()
        grid = reader.GetOutput()
        same(vtk_to_numpy(grid.GetPoints().GetData()), rows[:, 2:5], "points")
        same(vtk_to_numpy(grid.GetPointData().GetArray("velocity")), rows[:, 5:8], "velocity")
        same(vtk_to_numpy(grid.GetCellData().GetArray("tension")), members[:, 4], "tension")
        same(vtk_to_numpy(grid.GetCellData().GetArray("state")), numpy.sign(members[:, 4]), "state")
        assert grid.GetFieldData().GetArray("TimeValue").GetValue(0) == rows[0, 0]
        assert all(grid.GetCellType(cell) == 3 for cell in range(k))
    print(f"VTK {vtkVersion.GetVTKVersion()}: {f} frames")

try:
    import bpy
except ImportError:
    print("no Blender here (pip install bpy): its Mesh Cache did not play the samples")
else:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.obj_import(filepath=str(folder / "mesh.obj"), forward_axis="Y", up_axis="Z")
    (mesh,) = bpy.context.selected_objects
    edges = {tuple(sorted(edge.vertices)) for edge in mesh.data.edges}
    assert edges == {tuple(sorted(map(int, pair))) for pair in arrays["springs"]}
    cache = mesh.modifiers.new("cache", "MESH_CACHE")
    cache.cache_format, cache.filepath = "PC2", str(folder / "points.pc2")
    for frame, rows in enumerate(nodes):
        bpy.context.scene.frame_set(frame)
        played = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
        points = numpy.empty(3 * n, "f4")
        played.to_mesh().vertices.foreach_get("co", points)
        same(points.reshape(n, 3), rows[:, 2:5].astype("<f4"), "points")
        assert numpy.array_equal(played.matrix_world, numpy.eye(4))
    print(f"Blender {bpy.app.version_string}: mesh.obj with points.pc2, {f} frames")
