-- A base without a schema was read as the schema of its time, `roost.scenario/2`. Written down, so that points added later have its meaning.
UPDATE sweeps SET spec = json_set(spec, '$.base.schema', 'roost.scenario/2')
WHERE json_type(spec, '$.base') = 'object' AND json_extract(spec, '$.base.schema') IS NULL;
UPDATE studies SET spec = json_set(spec, '$.base.schema', 'roost.scenario/2')
WHERE json_type(spec, '$.base') = 'object' AND json_extract(spec, '$.base.schema') IS NULL;
-- Each test of a calibration has a base of its own.
UPDATE studies SET spec = json_set(spec, '$.goal.calibrate.measurements.tests', (
    SELECT json_group_array(json_set(value, '$.scenario.schema', coalesce(value ->> '$.scenario.schema', 'roost.scenario/2')))
    FROM json_each(spec, '$.goal.calibrate.measurements.tests')))
WHERE json_type(spec, '$.goal.calibrate.measurements.tests') = 'array';
