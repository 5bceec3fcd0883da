//! Meshes, and their files in parts.

use std::collections::BTreeMap;

use roost_api::mesh::MeshView;

use super::columns::{Columns, to_json};
use super::database::{Connection, Row, query, query_scalar};
use super::{Store, StoreError};

/// Length of every part of a file except the last.
const PART_BYTES: usize = 1024 * 1024;

impl Store {
    /// Stores a file part by part, then its row. Returns whether it is new. Simultaneous uploads of one file write the same rows.
    pub(crate) async fn insert_mesh(&self, mesh: MeshView, file: &[u8]) -> Result<bool, StoreError> {
        for (part, data) in file.chunks(PART_BYTES).enumerate() {
            let (digest, data) = (mesh.digest.clone(), data.to_vec());
            self.writer
                .write(move |tx| {
                    Box::pin(async move {
                        query(
                            "INSERT INTO mesh_parts (digest, part, data) VALUES (?, ?, ?)
                             ON CONFLICT (digest, part) DO NOTHING",
                        )
                        .bind(digest)
                        .bind(part as i64)
                        .bind(data)
                        .execute(&mut *tx)
                        .await?;
                        Ok(())
                    })
                })
                .await?;
        }
        let [low, high, size] = [mesh.low, mesh.high, mesh.size].map(|corner| to_json("mesh", &corner));
        let (low, high, size) = (low?, high?, size?);
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let inserted = query(
                        "INSERT INTO meshes (digest, bytes, format, triangles, degenerate, open_edges,
                                             turned_edges, low, high, size, uploaded_at)
                         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
                         ON CONFLICT (digest) DO NOTHING",
                    )
                    .bind(mesh.digest)
                    .bind(mesh.bytes as i64)
                    .bind(mesh.format.as_str())
                    .bind(mesh.triangles as i64)
                    .bind(mesh.degenerate as i64)
                    .bind(mesh.open_edges as i64)
                    .bind(mesh.turned_edges as i64)
                    .bind(low)
                    .bind(high)
                    .bind(size)
                    .bind(mesh.uploaded_at.0)
                    .execute(&mut *tx)
                    .await?;
                    Ok(inserted.rows_affected() == 1)
                })
            })
            .await
    }

    /// One mesh.
    pub(crate) async fn mesh(&self, digest: &str) -> Result<Option<MeshView>, StoreError> {
        let row =
            query("SELECT * FROM meshes WHERE digest = ?").bind(digest).fetch_optional(&self.readers).await?;
        row.as_ref().map(view).transpose()
    }

    /// Meshes, newest first, and the row that the next page starts before.
    pub(crate) async fn meshes(
        &self,
        before: Option<i64>,
        limit: u32,
    ) -> Result<(Vec<MeshView>, Option<i64>), StoreError> {
        let mut rows = query("SELECT * FROM meshes WHERE seq < ? ORDER BY seq DESC LIMIT ?")
            .bind(before.unwrap_or(i64::MAX))
            .bind(i64::from(limit) + 1)
            .fetch_all(&self.readers)
            .await?;
        let more = rows.len() > limit as usize;
        rows.truncate(limit as usize);
        let next = match rows.last() {
            Some(last) if more => Some(last.column("seq")?),
            _ => None,
        };
        Ok((rows.iter().map(view).collect::<Result<_, _>>()?, next))
    }

    /// Triangles of the meshes of a list that are stored.
    pub(crate) async fn mesh_triangles(&self, digests: &[&str]) -> Result<BTreeMap<String, u64>, StoreError> {
        let rows =
            query("SELECT digest, triangles FROM meshes WHERE digest IN (SELECT atom FROM json_each(?))")
                .bind(to_json("digests", &digests)?)
                .fetch_all(&self.readers)
                .await?;
        rows.iter().map(|row| Ok((row.column("digest")?, row.number("triangles")?))).collect()
    }

    /// One part of a file; none after the last.
    pub(crate) async fn mesh_part(&self, digest: &str, part: u32) -> Result<Option<Vec<u8>>, StoreError> {
        let data = query_scalar("SELECT data FROM mesh_parts WHERE digest = ? AND part = ?")
            .bind(digest)
            .bind(part)
            .fetch_optional(&self.readers)
            .await?;
        Ok(data)
    }

    /// A whole file; empty when it is not stored.
    pub(crate) async fn mesh_file(&self, digest: &str) -> Result<Vec<u8>, StoreError> {
        let mut file = Vec::new();
        for part in 0.. {
            let Some(data) = self.mesh_part(digest, part).await? else { break };
            file.extend(data);
        }
        Ok(file)
    }
}

/// Removes the parts of interrupted uploads.
pub(super) async fn sweep(connection: &mut Connection) -> Result<(), StoreError> {
    let swept = query("DELETE FROM mesh_parts WHERE digest NOT IN (SELECT digest FROM meshes)")
        .execute(connection)
        .await?;
    if swept.rows_affected() > 0 {
        tracing::info!(parts = swept.rows_affected(), "removed parts of interrupted uploads of meshes");
    }
    Ok(())
}

fn view(row: &Row) -> Result<MeshView, StoreError> {
    let open_edges = row.number("open_edges")?;
    Ok(MeshView {
        digest: row.column("digest")?,
        bytes: row.number("bytes")?,
        format: row.parsed("format")?,
        triangles: row.number("triangles")?,
        degenerate: row.number("degenerate")?,
        closed: open_edges == 0,
        open_edges,
        turned_edges: row.number("turned_edges")?,
        low: row.json("low")?,
        high: row.json("high")?,
        size: row.json("size")?,
        uploaded_at: row.moment("uploaded_at")?,
    })
}
