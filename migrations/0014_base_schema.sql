-- A base without a schema was read as the schema of its time, `roost.scenario/1`. Written down, so that points added later have its meaning.
UPDATE sweeps SET spec = json_set(spec, '$.base.schema', 'roost.scenario/1') WHERE json_extract(spec, '$.base.schema') IS NULL;
