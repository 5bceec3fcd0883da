//! Polygonal data as a VTK XML file (<https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>).
//!
//! Every array is inline: compressed in blocks, and written in base64. First come n + 3 numbers of 64 bits: the number n of blocks, the bytes
//! of a block, the bytes of the last block if it is shorter (else 0), and the compressed bytes of each block. The blocks follow in a second
//! base64 text.

use std::fmt::Write as _;
use std::io::Write as _;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;

/// Bytes of a block before compression; VTK's default.
const BLOCK: usize = 1 << 15;

/// Points, cells of one kind, and their arrays.
#[derive(Debug, Default)]
pub(super) struct PolyData {
    /// x, y, z of each point.
    pub(super) points: Vec<f32>,
    pub(super) point_data: Vec<Array>,
    pub(super) cells: Cells,
    pub(super) cell_data: Vec<Array>,
}

/// Cells by their corners, each an index of a point.
#[derive(Debug)]
pub(super) enum Cells {
    /// Two corners each.
    Lines(Vec<u64>),
    /// Three corners each.
    Triangles(Vec<u64>),
}

impl Default for Cells {
    fn default() -> Self {
        Self::Lines(Vec::new())
    }
}

/// Values of points or cells under one name.
#[derive(Debug)]
pub(super) struct Array {
    name: &'static str,
    components: usize,
    numbers: Numbers,
}

/// Numbers of one type.
#[derive(Debug)]
pub(super) enum Numbers {
    Float32(Vec<f32>),
    UInt32(Vec<u32>),
    UInt64(Vec<u64>),
}

impl From<Vec<f32>> for Numbers {
    fn from(numbers: Vec<f32>) -> Self {
        Self::Float32(numbers)
    }
}

impl From<Vec<u32>> for Numbers {
    fn from(numbers: Vec<u32>) -> Self {
        Self::UInt32(numbers)
    }
}

impl Numbers {
    fn type_name(&self) -> &'static str {
        match self {
            Self::Float32(_) => "Float32",
            Self::UInt32(_) => "UInt32",
            Self::UInt64(_) => "UInt64",
        }
    }

    /// Little-endian bytes.
    fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Float32(numbers) => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
            Self::UInt32(numbers) => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
            Self::UInt64(numbers) => numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
        }
    }
}

/// An array with a number for each point or cell.
pub(super) fn scalars(name: &'static str, numbers: impl Into<Numbers>) -> Array {
    Array { name, components: 1, numbers: numbers.into() }
}

/// An array with a vector for each point or cell.
pub(super) fn vectors(name: &'static str, numbers: Vec<f32>) -> Array {
    Array { name, components: 3, numbers: numbers.into() }
}

impl PolyData {
    /// The bytes of a `.vtp` file.
    pub(super) fn into_file(self) -> Vec<u8> {
        let (tag, corners_each, connectivity) = match self.cells {
            Cells::Lines(corners) => ("Lines", 2, corners),
            Cells::Triangles(corners) => ("Polys", 3, corners),
        };
        let count = connectivity.len() / corners_each;
        let offsets = (1..=count).map(|cell| (cell * corners_each) as u64).collect();
        let mut file = Text::default();
        file.line("<?xml version=\"1.0\"?>");
        file.line(
            "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\" \
             compressor=\"vtkZLibDataCompressor\">",
        );
        file.line("<PolyData>");
        file.line(format_args!(
            "<Piece NumberOfPoints=\"{}\" NumberOf{tag}=\"{count}\">",
            self.points.len() / 3
        ));
        file.attributes("PointData", &self.point_data);
        file.attributes("CellData", &self.cell_data);
        file.section("Points", "", &[vectors("Points", self.points)]);
        let corners = [("connectivity", connectivity), ("offsets", offsets)];
        let corners = corners.map(|(name, numbers)| scalars(name, Numbers::UInt64(numbers)));
        file.section(tag, "", &corners);
        file.line("</Piece>\n</PolyData>\n</VTKFile>");
        file.0.into_bytes()
    }
}

/// The text of a file.
#[derive(Default)]
struct Text(String);

impl Text {
    fn line(&mut self, line: impl std::fmt::Display) {
        writeln!(self.0, "{line}").expect("a string accepts all text");
    }

    /// The arrays of points or cells. ParaView colours by the first scalars at first.
    fn attributes(&mut self, tag: &str, arrays: &[Array]) {
        let mut active = String::new();
        for (kind, components) in [("Scalars", 1), ("Vectors", 3)] {
            if let Some(array) = arrays.iter().find(|array| array.components == components) {
                write!(active, " {kind}=\"{}\"", array.name).expect("a string accepts all text");
            }
        }
        self.section(tag, &active, arrays);
    }

    fn section(&mut self, tag: &str, attributes: &str, arrays: &[Array]) {
        self.line(format_args!("<{tag}{attributes}>"));
        for Array { name, components, numbers } in arrays {
            let kind = numbers.type_name();
            write!(
                self.0,
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">"
            )
            .expect("a string accepts all text");
            self.blocks(&numbers.bytes());
            self.line("</DataArray>");
        }
        self.line(format_args!("</{tag}>"));
    }

    fn blocks(&mut self, bytes: &[u8]) {
        let mut sizes = vec![0, BLOCK as u64, (bytes.len() % BLOCK) as u64];
        let mut packed = Vec::new();
        for block in bytes.chunks(BLOCK) {
            let start = packed.len();
            // Slower compression gains little: most bytes of a frame are random digits.
            // Level 1 of zlib-rs has fixed codes: files would be a fifth larger.
            let mut encoder = ZlibEncoder::new(&mut packed, Compression::new(2));
            encoder
                .write_all(block)
                .and_then(|()| encoder.finish().map(drop))
                .expect("memory accepts all bytes");
            sizes.push((packed.len() - start) as u64);
            sizes[0] += 1;
        }
        let sizes: Vec<u8> = sizes.into_iter().flat_map(u64::to_le_bytes).collect();
        BASE64_STANDARD.encode_string(sizes, &mut self.0);
        BASE64_STANDARD.encode_string(packed, &mut self.0);
    }
}
