//! Checks an answer against the specification of its operation.

use std::collections::HashMap;

use jsonschema::Validator;
use serde_json::{Value, json};

/// An answer.
pub(super) struct CheckedAnswer {
    pub status: u16,
    pub media_type: String,
    pub body: Vec<u8>,
}

/// Forbids fields that the specification does not document.
fn without_other_fields(mut schema: Value) -> Value {
    match &mut schema {
        Value::Object(fields) => {
            fields.values_mut().for_each(|value| *value = without_other_fields(value.take()));
            if fields.contains_key("properties") && !fields.contains_key("additionalProperties") {
                fields.insert("additionalProperties".to_owned(), json!(false));
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|value| *value = without_other_fields(value.take())),
        _ => {}
    }
    schema
}

/// Checks answers against the specification.
pub(super) struct AnswerChecker {
    components: Value,
    validators: HashMap<String, Validator>,
}

impl AnswerChecker {
    pub(super) fn new(spec: &Value) -> Self {
        Self { components: without_other_fields(spec["components"].clone()), validators: HashMap::new() }
    }

    /// The faults of an answer.
    pub(super) fn fault(&mut self, operation: &Value, answered: &CheckedAnswer) -> Option<String> {
        if answered.status >= 500 {
            return Some("the server's fault".to_owned());
        }
        let documented = &operation["responses"][answered.status.to_string()];
        if documented.is_null() {
            return Some("a status that is not documented".to_owned());
        }
        let Some(content) = documented["content"].as_object() else {
            return (!answered.body.is_empty()).then(|| "a body where none is documented".to_owned());
        };
        let media_type = answered.media_type.split(';').next().unwrap_or_default();
        let Some(media) = content.get(media_type) else {
            return Some(format!("the media type {media_type:?} is not documented"));
        };
        if !media_type.ends_with("json") {
            return None;
        }
        let Ok(body) = serde_json::from_slice::<Value>(&answered.body) else {
            return Some("not JSON".to_owned());
        };
        let schema = &media["schema"];
        let validator = self.validators.entry(schema.to_string()).or_insert_with(|| {
            let mut root = without_other_fields(schema.clone());
            root["components"] = self.components.clone();
            jsonschema::options().should_validate_formats(true).build(&root).unwrap()
        });
        validator.iter_errors(&body).next().map(|error| format!("{}: {error}", error.instance_path()))
    }
}

#[test]
fn answer_outside_the_specification_is_found() {
    let spec = json!({"components": {"schemas": {"Thing": {"type": "object", "required": ["id"],
        "properties": {"id": {"type": "string", "format": "uuid"}}}}}});
    let operation = json!({"responses": {"204": {"description": "none"}, "200": {"description": "a thing",
        "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Thing"}}}}}});
    let mut judge = AnswerChecker::new(&spec);
    let mut fault = |status, media_type: &str, body: Value| {
        let body = if body.is_null() { Vec::new() } else { body.to_string().into_bytes() };
        judge.fault(&operation, &CheckedAnswer { status, media_type: media_type.to_owned(), body })
    };
    let id = "01890000-0000-7000-8000-000000000000";
    assert_eq!(fault(200, "application/json", json!({"id": id})), None);
    assert_eq!(fault(204, "", Value::Null), None);
    for (status, media_type, body) in [
        (500, "application/json", json!({"id": id})),
        (404, "application/json", json!({"id": id})),
        (200, "text/plain", json!({"id": id})),
        (200, "application/json", json!({"id": 7})),
        (200, "application/json", json!({"id": "seven"})),
        (200, "application/json", json!({})),
        (200, "application/json", json!({"id": id, "more": 1})),
        (204, "application/json", json!({})),
    ] {
        assert!(fault(status, media_type, body.clone()).is_some(), "{status} {media_type} {body}");
    }
}
