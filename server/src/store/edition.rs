//! The edition of a database: no program leads it whose schema or solver is older than that of a server that has led it.
//!
//! The SQL of an older schema would damage a newer one. Results of two solvers must not be mixed. A server checks both when it begins
//! to lead, and with each new connection to PostgreSQL: another server may have led meanwhile.

use roost_solver::SOLVER_REVISION;
use sqlx::migrate::Migrator;

use super::StoreError;
use super::database::{Connection, Engine, query, query_scalar};
use super::migrations::{migrate_to, migrator, newest_known, newest_run, refuse_above, table_exists};

/// Schema and solver of a program.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edition {
    pub(super) solver_revision: u32,
    /// A migration after those of this program, in tests of upgrades.
    #[cfg(test)]
    pub(super) next_migration: Option<&'static str>,
}

impl Default for Edition {
    /// The edition of this program.
    fn default() -> Self {
        Self {
            solver_revision: SOLVER_REVISION,
            #[cfg(test)]
            next_migration: None,
        }
    }
}

impl Edition {
    fn migrator(self, engine: Engine) -> Migrator {
        #[cfg(test)]
        if let Some(sql) = self.next_migration {
            return super::migrations::migrator_with(engine, sql);
        }
        migrator(engine)
    }

    /// Migrates a database and notes the solver, before the first write of a server that leads. If the solver is newer than that of earlier
    /// leaders, their workers get no more jobs: no server of this solver would register them.
    pub(super) async fn take_lead(self, connection: &mut Connection) -> Result<(), StoreError> {
        // Before the migrations: a refused server changes nothing.
        self.refuse_newer(connection).await?;
        migrate_to(connection, &self.migrator(connection.engine())).await?;
        self.note_solver(connection).await
    }

    /// Notes the solver, where it is not noted.
    async fn note_solver(self, connection: &mut Connection) -> Result<(), StoreError> {
        if newest_solver(connection).await? == Some(i64::from(self.solver_revision)) {
            return Ok(());
        }
        let drain = "UPDATE workers SET draining = 1 WHERE solver_revision < ?";
        query(drain).bind(self.solver_revision).execute(&mut *connection).await?;
        let note = "INSERT INTO newest_solver (id, revision) VALUES (0, ?) ON CONFLICT (id) DO UPDATE SET revision = excluded.revision";
        query(note).bind(self.solver_revision).execute(connection).await?;
        Ok(())
    }

    /// Refuses a database that a server of another schema or of a newer solver has led meanwhile.
    pub(super) async fn keep_lead(self, connection: &mut Connection) -> Result<(), StoreError> {
        self.refuse_newer(connection).await?;
        let known = newest_known(&self.migrator(connection.engine()));
        match newest_run(connection).await? {
            // Its operator restores a dump, perhaps. Tables of this server would be in the way.
            None => Err(StoreError::Unsuitable {
                database: "the database".to_owned(),
                reason: "it has no tables of Roost now".to_owned(),
            }),
            Some(found) if found < known => Err(StoreError::Replaced { found, known }),
            // An earlier state of the database may lack the note.
            Some(_) => self.note_solver(connection).await,
        }
    }

    /// Refuses a database that a newer program has led.
    pub(super) async fn refuse_newer(self, connection: &mut Connection) -> Result<(), StoreError> {
        refuse_above(connection, newest_known(&self.migrator(connection.engine()))).await?;
        let own = i64::from(self.solver_revision);
        match newest_solver(connection).await? {
            Some(found) if found > own => Err(StoreError::NewerSolver { found, own }),
            _ => Ok(()),
        }
    }
}

/// The newest solver of a leader; none before the first.
async fn newest_solver(connection: &mut Connection) -> Result<Option<i64>, StoreError> {
    if !table_exists(connection, "newest_solver").await? {
        return Ok(None);
    }
    Ok(query_scalar("SELECT revision FROM newest_solver").fetch_optional(connection).await?)
}
