//! A strict reader of VTK polygonal data, independent of the writer, for tests of `roost-frames` and of the binary.

#![allow(dead_code, reason = "each test binary uses its own part")]

use std::collections::BTreeMap;
use std::io::Read;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use flate2::read::ZlibDecoder;
use roxmltree::{Document, Node};

/// The content of a file; numbers of all types become f64, which is exact here.
#[derive(Debug)]
pub(crate) struct PolyData {
    /// x, y, z of each point.
    pub(crate) points: Vec<f64>,
    pub(crate) of_points: BTreeMap<String, Array>,
    pub(crate) of_cells: BTreeMap<String, Array>,
    /// Corners of each line.
    pub(crate) lines: Vec<Vec<u64>>,
    /// Corners of each polygon.
    pub(crate) polygons: Vec<Vec<u64>>,
}

#[derive(Debug)]
pub(crate) struct Array {
    /// Name of the type in VTK, such as `Float32`.
    pub(crate) kind: String,
    pub(crate) components: usize,
    pub(crate) numbers: Vec<f64>,
}

/// Reads a `.vtp` file.
pub(crate) fn read(bytes: &[u8]) -> PolyData {
    let text = std::str::from_utf8(bytes).expect("UTF-8");
    let document = Document::parse(text).expect("XML");
    let root = document.root_element();
    let expected = [
        ("type", "PolyData"),
        ("version", "1.0"),
        ("byte_order", "LittleEndian"),
        ("header_type", "UInt64"),
        ("compressor", "vtkZLibDataCompressor"),
    ];
    assert_eq!(root.tag_name().name(), "VTKFile");
    assert_eq!(root.attributes().map(|a| (a.name(), a.value())).collect::<Vec<_>>(), expected);
    let piece = only(only(root, "PolyData"), "Piece");
    let count = |name: &str| piece.attribute(name).map_or(0, |count| count.parse().expect("a count"));
    let points = arrays(only(piece, "Points")).remove("Points").expect("points");
    assert_eq!((points.kind.as_str(), points.components), ("Float32", 3));
    assert_eq!(points.numbers.len(), 3 * count("NumberOfPoints"));
    assert!(piece.has_attribute("NumberOfPoints"), "VTK insists on it");
    let (lines, polygons) = (cells(piece, "Lines"), cells(piece, "Polys"));
    assert_eq!([lines.len(), polygons.len()], ["NumberOfLines", "NumberOfPolys"].map(count));
    let corners = lines.iter().chain(&polygons).flatten();
    assert!(
        corners.into_iter().all(|&corner| (corner as usize) < count("NumberOfPoints")),
        "a corner is no point"
    );
    let carried = |tag: &str, bearers: usize| {
        let arrays = arrays(only(piece, tag));
        for (name, array) in &arrays {
            assert_eq!(array.numbers.len(), array.components * bearers, "{tag} {name}");
        }
        for (kind, components) in [("Scalars", 1), ("Vectors", 3)] {
            let chief = only(piece, tag).attribute(kind);
            assert!(chief.is_none_or(|name| arrays[name].components == components), "{tag} {kind} {chief:?}");
        }
        arrays
    };
    PolyData {
        of_points: carried("PointData", count("NumberOfPoints")),
        of_cells: carried("CellData", lines.len() + polygons.len()),
        points: points.numbers,
        lines,
        polygons,
    }
}

impl PolyData {
    /// A data array of points or cells.
    pub(crate) fn numbers<'a>(carried: &'a BTreeMap<String, Array>, name: &str) -> &'a [f64] {
        &carried.get(name).unwrap_or_else(|| panic!("no {name}")).numbers
    }
}

fn elements<'a>(node: Node<'a, 'a>, tag: &str) -> Vec<Node<'a, 'a>> {
    node.children().filter(|child| child.has_tag_name(tag)).collect()
}

fn only<'a>(node: Node<'a, 'a>, tag: &str) -> Node<'a, 'a> {
    let found = elements(node, tag);
    assert_eq!(found.len(), 1, "{tag} in {}", node.tag_name().name());
    found[0]
}

fn arrays(section: Node<'_, '_>) -> BTreeMap<String, Array> {
    let array = |node: &Node<'_, '_>| {
        let attribute = |name| node.attribute(name).unwrap_or_else(|| panic!("no {name}")).to_owned();
        assert_eq!(attribute("format"), "binary");
        let kind = attribute("type");
        let bytes = unpacked(node.text().unwrap_or_default());
        let numbers = match kind.as_str() {
            "Float32" => numbers(&bytes, |b| f32::from_le_bytes(b).into()),
            "UInt32" => numbers(&bytes, |b| u32::from_le_bytes(b).into()),
            "UInt64" => numbers(&bytes, |b| u64::from_le_bytes(b) as f64),
            other => panic!("{other}"),
        };
        (
            attribute("Name"),
            Array { kind, components: attribute("NumberOfComponents").parse().unwrap(), numbers },
        )
    };
    elements(section, "DataArray").iter().map(array).collect()
}

fn numbers<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    let (chunks, rest) = bytes.as_chunks();
    assert!(rest.is_empty());
    chunks.iter().map(|chunk| number(*chunk)).collect()
}

fn cells(piece: Node<'_, '_>, tag: &str) -> Vec<Vec<u64>> {
    if elements(piece, tag).is_empty() {
        return Vec::new();
    }
    let arrays = arrays(only(piece, tag));
    let whole = |name: &str| {
        assert_eq!(arrays[name].kind, "UInt64");
        arrays[name].numbers.iter().map(|number| *number as u64).collect::<Vec<_>>()
    };
    let (corners, ends) = (whole("connectivity"), whole("offsets"));
    assert_eq!(ends.last().map_or(0, |end| *end as usize), corners.len());
    let starts = std::iter::once(0).chain(ends.iter().copied());
    starts.zip(&ends).map(|(start, end)| corners[start as usize..*end as usize].to_vec()).collect()
}

/// The bytes of an array: sizes in base64, then its compressed blocks in base64.
fn unpacked(text: &str) -> Vec<u8> {
    let size = |bytes: &[u8]| u64::from_le_bytes(bytes.try_into().unwrap()) as usize;
    let encoded = |bytes: usize| bytes.div_ceil(3) * 4;
    let first = BASE64_STANDARD.decode(&text[..32]).unwrap();
    let [count, block, last] = [0, 8, 16].map(|at| size(&first[at..at + 8]));
    let (head, blocks) = text.split_at(encoded(8 * (3 + count)));
    let sizes = BASE64_STANDARD.decode(head).unwrap();
    let blocks = BASE64_STANDARD.decode(blocks).unwrap();
    let (mut bytes, mut at) = (Vec::new(), 0);
    for (index, packed) in sizes[24..].chunks_exact(8).map(size).enumerate() {
        let before = bytes.len();
        ZlibDecoder::new(&blocks[at..at + packed]).read_to_end(&mut bytes).unwrap();
        at += packed;
        let is_short = index + 1 == count && last > 0;
        assert_eq!(bytes.len() - before, if is_short { last } else { block });
    }
    assert_eq!(at, blocks.len());
    bytes
}
