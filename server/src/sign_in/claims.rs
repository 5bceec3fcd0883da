//! The claims of the provider about a user.

use roost_api::job::MAX_NAME_BYTES;
use serde_json::{Map, Value};

/// The claim that names a user if the chosen one is missing.
const OTHER_NAME: &str = "preferred_username";

/// A user, as the provider describes one.
#[derive(Clone, Debug)]
pub(super) struct Claims {
    /// The user for ever, within the provider.
    pub(super) subject: String,
    pub(super) all: Map<String, Value>,
}

impl Claims {
    /// Whether both claims are known.
    pub(super) fn have(&self, user: &str, groups: &str) -> bool {
        self.all.contains_key(user) && self.all.contains_key(groups)
    }

    /// Adds what the ID token has left out.
    pub(super) fn complete(&mut self, more: Map<String, Value>) {
        // An e-mail address and its state belong together.
        let has_email = self.all.contains_key("email");
        if !has_email {
            self.all.remove("email_verified");
        }
        for (name, value) in more {
            if !(has_email && name == "email_verified") {
                self.all.entry(name).or_insert(value);
            }
        }
    }

    /// Name of the user: the chosen claim, else the preferred name, else the subject.
    pub(super) fn user(&self, claim: &str) -> String {
        // Some providers let users choose the other name, so that it may be the address of somebody else.
        let other = || self.name(OTHER_NAME).filter(|name| claim != "email" || !name.contains('@'));
        self.name(claim).or_else(other).unwrap_or(&self.subject).to_owned()
    }

    fn name(&self, claim: &str) -> Option<&str> {
        // Some providers let users enter the address of somebody else.
        if claim == "email" && !self.is_true("email_verified") {
            return None;
        }
        let text = self.all.get(claim)?.as_str()?.trim();
        let is_allowed = !text.chars().any(char::is_control) && (1..=MAX_NAME_BYTES).contains(&text.len());
        is_allowed.then_some(text)
    }

    /// Some providers send a text.
    fn is_true(&self, claim: &str) -> bool {
        match self.all.get(claim) {
            Some(Value::Bool(is_true)) => *is_true,
            Some(Value::String(text)) => text == "true",
            _ => false,
        }
    }

    /// Groups of the user: a list of texts, or a single one.
    pub(super) fn groups(&self, claim: &str) -> Vec<String> {
        match self.all.get(claim) {
            Some(Value::Array(groups)) => {
                groups.iter().filter_map(Value::as_str).map(str::to_owned).collect()
            }
            Some(Value::String(group)) => vec![group.clone()],
            _ => Vec::new(),
        }
    }
}
