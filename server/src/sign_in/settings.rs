//! The options of sign-in, checked all at once, and the rules who may do what.

use std::collections::BTreeSet;
use std::net::IpAddr;
use std::path::PathBuf;
use std::time::Duration;

use reqwest::Url;
use roost_api::token::Scope;

/// Where the provider sends the browser back to, on this server.
pub(crate) const CALLBACK: &str = "/dashboard/sign-in/callback";

/// The group of every user.
const EVERYBODY: &str = "*";

/// The options as the operator gave them.
#[derive(Clone, Debug, Default)]
pub struct SignInOptions {
    /// `--oidc-issuer`
    pub issuer: Option<String>,
    /// `--oidc-client-id`
    pub client_id: Option<String>,
    /// `--oidc-client-secret-file`
    pub client_secret_file: Option<PathBuf>,
    /// `--oidc-redirect`
    pub redirect: Option<String>,
    /// `--oidc-allow`
    pub allow: Vec<String>,
    /// `--oidc-groups-claim`
    pub groups_claim: String,
    /// `--oidc-user-claim`
    pub user_claim: String,
    /// `--oidc-session`
    pub session: Duration,
}

/// Settings without a fault.
#[derive(Clone)]
pub struct SignInSettings {
    /// The provider, exactly as its tokens name it.
    pub(crate) issuer: String,
    pub(crate) client_id: String,
    pub(crate) client_secret: String,
    /// The address of this server in browsers, without a path.
    pub(crate) own: Url,
    rules: Vec<Rule>,
    pub(crate) groups_claim: String,
    pub(crate) user_claim: String,
    pub(crate) session: Duration,
}

/// Users of a group get a scope in a project.
#[derive(Clone, Debug, PartialEq)]
struct Rule {
    group: String,
    project: String,
    scope: Scope,
}

/// The rights of a user: a project, and scopes in it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grant {
    pub(crate) project: String,
    pub(crate) scopes: Vec<Scope>,
}

/// Secrets stay out of logs.
impl std::fmt::Debug for SignInSettings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { issuer, client_id, own, rules, .. } = self;
        write!(f, "SignInSettings {{ {issuer:?}, {client_id:?}, {own}, {rules:?}, .. }}")
    }
}

impl SignInSettings {
    /// The settings; none without any option. Otherwise a line for each fault.
    pub fn of(options: &SignInOptions) -> Result<Option<Self>, Vec<String>> {
        let SignInOptions { issuer, client_id, client_secret_file, redirect, allow, .. } = options;
        let has_none = issuer.is_none() && client_id.is_none() && client_secret_file.is_none();
        if has_none && redirect.is_none() && allow.is_empty() {
            return Ok(None);
        }
        let mut faults = Vec::new();
        let mut given = |option: &str, value: &Option<String>, example: &str| {
            let value = value.as_deref().map(str::trim).filter(|value| !value.is_empty());
            if value.is_none() {
                faults.push(format!("{option} is missing: {example}"));
            }
            value.map(str::to_owned)
        };
        let issuer = given(
            "--oidc-issuer",
            issuer,
            "give the address of the provider, such as https://idp.example/realms/lab",
        );
        let client_id = given("--oidc-client-id", client_id, "give the client that the provider knows");
        let redirect = given(
            "--oidc-redirect",
            redirect,
            "give the address of this server in browsers, such as https://roost.example",
        );
        for claim in
            [("--oidc-groups-claim", &options.groups_claim), ("--oidc-user-claim", &options.user_claim)]
        {
            given(claim.0, &Some(claim.1.clone()), "give the name of a claim");
        }
        let mut found = |result: Result<_, String>| result.map_err(|fault| faults.push(fault)).ok();
        let issuer =
            issuer.map(|text| address("--oidc-issuer", &text, true).map(|_| text)).and_then(&mut found);
        let secret = found(secret(client_secret_file.as_ref()));
        let own = redirect.and_then(|text| {
            address("--oidc-redirect", &text, false).map_err(|fault| faults.push(fault)).ok()
        });
        if allow.is_empty() {
            faults.push("--oidc-allow is missing: give a rule such as 'scientists=default:submit'; the group * has every user".to_owned());
        }
        let read = |text: &String| rule(text).map_err(|fault| faults.push(fault)).ok();
        let rules: Vec<_> = allow.iter().filter_map(read).collect();
        let (Some(issuer), Some(client_id), Some(client_secret), Some(own), true) =
            (issuer, client_id, secret, own, faults.is_empty())
        else {
            return Err(faults);
        };
        let (groups_claim, user_claim) = (options.groups_claim.clone(), options.user_claim.clone());
        let session = options.session;
        Ok(Some(Self { issuer, client_id, client_secret, own, rules, groups_claim, user_claim, session }))
    }

    /// Host and port of the provider, for its button.
    pub(crate) fn provider_host(&self) -> String {
        let issuer = Url::parse(&self.issuer).ok();
        issuer.map_or_else(String::new, |url| url.authority().to_owned())
    }

    /// Whether browsers reach this server over https, so that cookies may be limited to it.
    pub(crate) fn is_https(&self) -> bool {
        self.own.scheme() == "https"
    }

    /// The address that the provider sends browsers back to.
    pub(crate) fn callback(&self) -> String {
        self.own.join(CALLBACK).expect("an address with another path").into()
    }

    /// The projects of all rules.
    pub(crate) fn projects(&self) -> BTreeSet<&str> {
        self.rules.iter().map(|rule| rule.project.as_str()).collect()
    }

    /// The rights of the users of these groups. The first rule that fits gives the project; all that fit in this project give
    /// scopes.
    pub(crate) fn grant(&self, groups: &[String]) -> Option<Grant> {
        let fits = |rule: &&Rule| rule.group == EVERYBODY || groups.contains(&rule.group);
        let project = self.rules.iter().find(fits)?.project.clone();
        let of_project = self.rules.iter().filter(fits).filter(|rule| rule.project == project);
        let given: Vec<_> = of_project.map(|rule| rule.scope).collect();
        let scopes = Scope::ALL.iter().copied().filter(|scope| given.contains(scope)).collect();
        Some(Grant { project, scopes })
    }
}

/// An address that no other machine can read or change on its way.
fn address(option: &str, text: &str, may_have_path: bool) -> Result<Url, String> {
    let allowed = if may_have_path { "with or without a path" } else { "without a path" };
    let fault = || {
        format!(
            "{option} {text:?} is not allowed: allowed is https://HOST {allowed}, and http:// for loopback addresses alone"
        )
    };
    let url = Url::parse(text).map_err(|_| fault())?;
    let is_plain = url.query().is_none() && url.fragment().is_none() && url.username().is_empty();
    let has_path = url.path() != "/";
    if is_safe(&url) && is_plain && (may_have_path || !has_path) { Ok(url) } else { Err(fault()) }
}

/// Whether nobody else reads or changes what is sent to an address.
pub(super) fn is_safe(url: &Url) -> bool {
    url.scheme() == "https" || (url.scheme() == "http" && is_loopback(url))
}

/// Whether an address is on this machine.
pub(super) fn is_loopback(url: &Url) -> bool {
    let host = url.host_str().unwrap_or_default();
    let ip = host.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    host == "localhost" || ip.is_ok_and(|ip| ip.is_loopback())
}

fn secret(file: Option<&PathBuf>) -> Result<String, String> {
    let option = "--oidc-client-secret-file";
    let file =
        file.ok_or_else(|| format!("{option} is missing: give a file with the secret of the client"))?;
    let name = file.display();
    let text =
        std::fs::read_to_string(file).map_err(|error| format!("{option} {name} cannot be read: {error}"))?;
    let secret = text.trim();
    match secret.is_empty() || secret.contains(char::is_control) {
        true => Err(format!("{option} {name} has no secret: allowed is one line of text")),
        false => Ok(secret.to_owned()),
    }
}

/// Reads `GROUP=PROJECT:SCOPE`. The name of a group may have the sign itself, such as `cn=lab`.
fn rule(text: &str) -> Result<Rule, String> {
    let scopes: Vec<_> = Scope::ALL.iter().map(|scope| scope.as_str()).collect();
    let fault = || {
        let scopes = scopes.join(", ");
        format!(
            "--oidc-allow {text:?} is not allowed: allowed is GROUP=PROJECT:SCOPE with a scope of {scopes}"
        )
    };
    let (group, right) = text.rsplit_once('=').ok_or_else(fault)?;
    let (project, scope) = right.split_once(':').ok_or_else(fault)?;
    let scope = scope.trim().parse().map_err(|_| fault())?;
    let (group, project) = (group.trim().to_owned(), project.trim().to_owned());
    if group.is_empty() || project.is_empty() {
        return Err(fault());
    }
    Ok(Rule { group, project, scope })
}
