-- PostgreSQL cannot read the character U+0000 in a text.
-- Bases without a schema have the schema `roost.scenario/2`, as the migration 0025 of SQLite writes it down.
UPDATE sweeps SET spec = jsonb_set(replace(spec, '\u0000', '\ufffd')::jsonb, '{base,schema}', '"roost.scenario/2"')::text
WHERE replace(spec, '\u0000', '\ufffd')::json #>> '{base,schema}' IS NULL AND json_typeof(replace(spec, '\u0000', '\ufffd')::json -> 'base') = 'object';
UPDATE studies SET spec = jsonb_set(replace(spec, '\u0000', '\ufffd')::jsonb, '{base,schema}', '"roost.scenario/2"')::text
WHERE replace(spec, '\u0000', '\ufffd')::json #>> '{base,schema}' IS NULL AND json_typeof(replace(spec, '\u0000', '\ufffd')::json -> 'base') = 'object';
-- Each test of a calibration has a base of its own.
UPDATE studies SET spec = jsonb_set(replace(spec, '\u0000', '\ufffd')::jsonb, '{goal,calibrate,measurements,tests}', (
    SELECT jsonb_agg(jsonb_set(test, '{scenario,schema}', coalesce(test #> '{scenario,schema}', '"roost.scenario/2"')) ORDER BY place)
    FROM jsonb_array_elements(replace(spec, '\u0000', '\ufffd')::jsonb #> '{goal,calibrate,measurements,tests}') WITH ORDINALITY AS tests (test, place)))::text
WHERE json_typeof(replace(spec, '\u0000', '\ufffd')::json #> '{goal,calibrate,measurements,tests}') = 'array';
