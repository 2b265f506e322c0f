"""Clouds from and to files: what is there is read, what is cut off is said."""

import pickle
import struct

import numpy as np
import pytest

from coursekit.recordings import read_cloud, write_cloud

POINTS = np.random.default_rng(0).normal(size=(20, 3))
ENDINGS = [".ply", ".pcd", ".npy"]


def written(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("d", [2, 3])
def test_what_is_written_is_read_to_the_bit(tmp_path, ending, d):
    points = np.vstack([POINTS[:, :d], np.zeros(d), np.full(d, 1e300)])
    path = tmp_path / f"cloud{ending}"
    write_cloud(path, points)
    np.testing.assert_array_equal(read_cloud(path, zeros=True), points)
    with pytest.warns(UserWarning, match="1 points dropped: 0 × NaN or infinity, 1 × at the origin"):
        assert len(read_cloud(path)) == len(points) - 1


@pytest.mark.parametrize("ending", [".ply", ".pcd"])
def test_a_file_cut_off_anywhere_says_so(tmp_path, ending):
    """Every byte of the header, and a few of the points."""
    path = tmp_path / f"cloud{ending}"
    write_cloud(path, POINTS)
    whole = path.read_bytes()
    start = len(whole) - POINTS.nbytes
    for length in [*range(start), start, start + 1, start + 24, len(whole) - 1]:
        with pytest.raises(ValueError, match=r"cut off|empty|no usable row|cannot be read|expected"):
            read_cloud(written(path, whole[:length]))
    with pytest.raises(ValueError, match="its header promises 20 points, it holds 19"):
        read_cloud(written(path, whole[:-1]))


def test_an_npy_file_cut_off_and_a_pickle_in_one_say_so(tmp_path):
    path = tmp_path / "cloud.npy"
    write_cloud(path, POINTS)
    whole = path.read_bytes()
    for length in (8, 40, len(whole) - 1):
        with pytest.raises(ValueError, match="no array of numbers can be read"):
            read_cloud(written(path, whole[:length]))
    np.save(path, np.array([{"x": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match="no array of numbers can be read"):
        read_cloud(path)
    with pytest.raises(ValueError, match="binary"):
        read_cloud(written(path, pickle.dumps(POINTS)))


PLY_HEAD = "ply\nformat {} 1.0\ncomment made by hand\nelement vertex 3\nproperty float x\nproperty float y\n"
PLY_HEAD += "property float z\nproperty uchar red\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
CORNERS = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9]])


def test_no_face_of_a_ply_file_is_taken_for_a_point(tmp_path):
    text = PLY_HEAD.format("ascii") + "1 2 3 255\n4 5 6 255\n7 8 9 0\n3 0 1 2\n3 2 1 0\n"
    np.testing.assert_array_equal(read_cloud(written(tmp_path / "a.ply", text)), CORNERS)
    np.testing.assert_array_equal(read_cloud(written(tmp_path / "b.ply", text.replace("\n", "\r\n"))), CORNERS)


@pytest.mark.parametrize(("name", "order"), [("binary_little_endian", "<"), ("binary_big_endian", ">")])
def test_binary_ply_of_either_byte_order_is_read(tmp_path, name, order):
    body = b"".join(struct.pack(f"{order}fffB", *row, 255) for row in CORNERS)
    faces = struct.pack(f"{order}Biii", 3, 0, 1, 2) * 2
    path = written(tmp_path / "a.ply", PLY_HEAD.format(name).encode() + body + faces)
    np.testing.assert_array_equal(read_cloud(path), CORNERS)


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian"])
def test_elements_before_the_points_are_skipped(tmp_path, order):
    head = f"ply\nformat {order} 1.0\nelement strip 2\nproperty list uchar short index\nproperty float w\n"
    head += "element vertex 1\nproperty double y\nproperty double x\nend_header\n"
    body = b"2 7 8 0.5\n0 0.5\n2 1\n"
    if order != "ascii":
        body = struct.pack("<Bhhf", 2, 7, 8, 0.5) + struct.pack("<Bf", 0, 0.5) + struct.pack("<dd", 2.0, 1.0)
    np.testing.assert_array_equal(read_cloud(written(tmp_path / "a.ply", head.encode() + body)), [[1, 2]])


PCD_HEAD = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb normal\nSIZE 4 4 4 4 4\nTYPE F F F U F\nCOUNT 1 1 1 1 3\n"
PCD_HEAD += "WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA {}\n"


def test_pcd_as_text_and_as_bytes_is_read_and_what_was_not_seen_is_counted(tmp_path):
    text = PCD_HEAD.format("ascii") + "1 2 3 9 0 0 1\nnan nan nan 9 0 0 1\n7 8 9 9 0 0 1\n"
    body = b"".join(struct.pack("<fffIfff", *row, 9, 0, 0, 1) for row in ([1, 2, 3], [np.nan] * 3, [7, 8, 9]))
    for content in (text.encode(), PCD_HEAD.format("binary").encode() + body):
        with pytest.warns(UserWarning, match="1 points dropped: 1 × NaN"):
            np.testing.assert_array_equal(read_cloud(written(tmp_path / "a.pcd", content)), CORNERS[[0, 2]])
    with pytest.raises(ValueError, match="binary_compressed; save it again without compression"):
        read_cloud(written(tmp_path / "a.pcd", PCD_HEAD.format("binary_compressed").encode() + body))
    with pytest.raises(ValueError, match="promises 3 points, it holds 2"):
        read_cloud(written(tmp_path / "a.pcd", text.rsplit("7 8", 1)[0]))


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("x,y,z\n1,2,3\n4,5,6\n", [[1, 2, 3], [4, 5, 6]]),
        ("time;Y [m];X [m]\n0.1;2;1\n0.2;5;4\n", [[1, 2], [4, 5]]),
        ("\ufeffX\tY\tZ\tIntensity\r\n1\t2\t3\t9\r\n", [[1, 2, 3]]),
        ("1 2\n4 5\n", [[1, 2], [4, 5]]),
        ("1, 2, 3\n4, 5, 6\n", [[1, 2, 3], [4, 5, 6]]),
        ("# x y z\n1e0 2 3\n\n4 5 6 # last\n", [[1, 2, 3], [4, 5, 6]]),
    ],
)
def test_columns_of_text_are_found_by_their_names_or_their_number(tmp_path, text, points):
    path = written(tmp_path / "cloud.csv", text)
    np.testing.assert_array_equal(read_cloud(path), points)


def test_more_columns_want_to_be_named(tmp_path):
    path = written(tmp_path / "cloud.txt", "1 2 3 0.5\n4 5 6 0.7\n")
    with pytest.raises(ValueError, match=r"expected two or three columns, got 4; say which by columns=\(0, 1, 2\)"):
        read_cloud(path)
    np.testing.assert_array_equal(read_cloud(path, columns=(0, 1, 2)), [[1, 2, 3], [4, 5, 6]])
    named = written(path, "east,north,up\n1,2,3\n")
    np.testing.assert_array_equal(read_cloud(named, columns=("east", "north")), [[1, 2]])
    with pytest.raises(ValueError, match="columns: expected two or three of"):
        read_cloud(named, columns=("x", "y"))
    np.save(tmp_path / "scan.npy", np.ones((5, 4), dtype="f4"))
    with pytest.raises(ValueError, match="expected two or three columns, got 4"):
        read_cloud(tmp_path / "scan.npy")
    assert read_cloud(tmp_path / "scan.npy", columns=(0, 1, 2)).dtype == float


def test_bad_headers_and_bad_clouds_get_a_sentence(tmp_path):
    path = tmp_path / "a.ply"
    for content, said in (
        ("ply\nformat ascii 2.0\nend_header\n", "a line of the PLY header cannot be read: 'format ascii 2.0'"),
        ("ply\nformat ascii 1.0\nelement face 1\nend_header\n", "expected an element vertex"),
        ("ply\nelement vertex 0\nend_header\n", "expected one of the formats"),
        ("VERSION 0.7\nFIELDS x y\nSIZE 4\nTYPE F F\nPOINTS 1\nDATA ascii\n1 2\n", "the PCD header is not complete"),
    ):
        with pytest.raises(ValueError, match=said):
            read_cloud(written(path, content))
    with pytest.raises(ValueError, match=r"ends in .ply, .pcd or .npy, got 'a.obj'"):
        write_cloud(tmp_path / "a.obj", POINTS)
    for bad in (np.ones((3, 4)), np.ones(3), np.empty((0, 3))):
        with pytest.raises(ValueError, match="points: expected one or more of shape"):
            write_cloud(path, bad)
    with pytest.raises(ValueError, match="points: expected finite"):
        write_cloud(path, [[1.0, np.nan]])
    with pytest.raises(FileNotFoundError):
        read_cloud(tmp_path / "none.ply")


@pytest.mark.parametrize("ending", [".ply", ".pcd"])
def test_open3d_reads_what_is_written(tmp_path, ending):
    io = pytest.importorskip("open3d").io
    write_cloud(tmp_path / f"cloud{ending}", POINTS)
    np.testing.assert_allclose(np.asarray(io.read_point_cloud(str(tmp_path / f"cloud{ending}")).points), POINTS)
