//! Files that ParaView opens: fillets and equipment of every frame as polygonal data, and a collection of them all.
//!
//! [`particles`] gives the sub-particles and the bonds that hold, [`surfaces`] the equipment where it is, and
//! [`collection`] the one file to open. What ParaView shows of them is told in `docs/frames.md`.

mod collection;
mod particles;
mod surfaces;
#[cfg(test)]
mod tests;

use std::fmt::{self, Write};

use vtkio::model::{
    Attribute, ByteOrder, DataArrayBase, DataSet, ElementType, IOBuffer, PolyDataPiece, Version,
    VertexNumbers, Vtk,
};
use vtkio::xml::Compressor;

pub use collection::{Scene, collection};
pub use particles::particles;
pub use surfaces::{legend, surfaces};

/// Fast, and nearly as small as it gets: most of a frame is digits that nothing predicts.
const COMPRESSION_LEVEL: u32 = 1;
/// A frame cannot be written as VTK.
#[derive(Debug)]
pub struct Error(vtkio::xml::Error);

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot make a VTK file: {}", self.0)
    }
}

impl std::error::Error for Error {}

/// A value a point or cell.
fn scalars(name: &str, data: impl Into<IOBuffer>) -> Attribute {
    array(name, ElementType::Scalars { num_comp: 1, lookup_table: None }, data)
}

/// A vector a point or cell.
fn vectors(name: &str, data: Vec<f32>) -> Attribute {
    array(name, ElementType::Vectors, data)
}

fn array(name: &str, elem: ElementType, data: impl Into<IOBuffer>) -> Attribute {
    Attribute::DataArray(DataArrayBase { name: name.to_owned(), elem, data: data.into() })
}

/// Cells of so many corners each, from the corners of all.
fn cells(corners_each: usize, connectivity: Vec<u64>) -> Option<VertexNumbers> {
    let offsets = (1..=connectivity.len() / corners_each).map(|k| (k * corners_each) as u64).collect();
    (!connectivity.is_empty()).then_some(VertexNumbers::XML { connectivity, offsets })
}

/// The bytes of a `.vtp` file.
fn file(piece: PolyDataPiece) -> Result<Vec<u8>, Error> {
    let is_empty = piece.points.is_empty();
    let vtk = Vtk {
        version: Version::new_xml(1, 0),
        byte_order: ByteOrder::LittleEndian,
        title: String::new(),
        file_path: None,
        data: DataSet::inline(piece),
    };
    let file = vtk.try_into_xml_format(Compressor::ZLib, COMPRESSION_LEVEL).map_err(Error)?;
    let mut text = String::new();
    write!(text, "{file}").map_err(|_| Error(vtkio::xml::Error::Unknown))?;
    if is_empty {
        // The library leaves out counts of zero; VTK insists on this one.
        text = text.replacen("<Piece", "<Piece NumberOfPoints=\"0\"", 1);
    }
    Ok(text.into_bytes())
}
