-- Replicates in a row that have the same parameters, in a sweep whose replicates draw them from a posterior; null in any other.
ALTER TABLE sweeps ADD COLUMN runs_per_sample INTEGER CHECK (runs_per_sample > 0);
