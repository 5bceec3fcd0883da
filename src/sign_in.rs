//! The options of a server for sign-in with an identity provider.

use std::path::PathBuf;

use anyhow::{Result, bail};
use roost_server::{SignInOptions, SignInSettings};

use crate::interval;

/// The options. All of them are texts here, so that one error names all faults.
#[derive(Debug, clap::Args)]
pub(crate) struct SignInArgs {
    /// Address of the OpenID Connect provider with which users sign in to the dashboard. Write the address exactly as the provider
    /// states it (the issuer)
    #[arg(long = "oidc-issuer", env = "ROOST_OIDC_ISSUER", hide_env_values = true, value_name = "URL")]
    issuer: Option<String>,
    /// Client id of this server at the provider
    #[arg(long = "oidc-client-id", env = "ROOST_OIDC_CLIENT_ID", hide_env_values = true, value_name = "ID")]
    client_id: Option<String>,
    /// File with the client secret of this server
    #[arg(
        long = "oidc-client-secret-file",
        env = "ROOST_OIDC_CLIENT_SECRET_FILE",
        hide_env_values = true,
        value_name = "FILE"
    )]
    client_secret_file: Option<PathBuf>,
    /// Address of this server in browsers, such as `https://roost.example`. The provider sends browsers back to the path
    /// `/dashboard/sign-in/callback` of this address
    #[arg(long = "oidc-redirect", env = "ROOST_OIDC_REDIRECT", hide_env_values = true, value_name = "URL")]
    redirect: Option<String>,
    /// Rule that states which users may sign in: the users of the group GROUP of the provider get the scope SCOPE in the project
    /// PROJECT. The group `*` has every user of the provider. For several rules, repeat the option, or write each rule on its own
    /// line of the environment variable. The first rule that fits a user selects the project of the user. The user gets the scopes
    /// of all rules that fit the user and name this project
    #[arg(
        long = "oidc-allow",
        env = "ROOST_OIDC_ALLOW",
        hide_env_values = true,
        value_delimiter = '\n',
        value_name = "GROUP=PROJECT:SCOPE"
    )]
    allow: Vec<String>,
    /// Name of the claim that has the groups of a user. A claim is a named value in the data that the provider sends about a user
    #[arg(
        long = "oidc-groups-claim",
        env = "ROOST_OIDC_GROUPS_CLAIM",
        hide_env_values = true,
        default_value = "groups",
        value_name = "CLAIM"
    )]
    groups_claim: String,
    /// Name of the claim that has the name of a user. The claim `email` counts as missing if the provider has not verified the
    /// address. If the claim is missing, the server takes the claim `preferred_username`. With the value `email`, the server does
    /// not take a `preferred_username` that contains `@`. If the server finds no name in these claims, it takes the claim `sub`
    #[arg(
        long = "oidc-user-claim",
        env = "ROOST_OIDC_USER_CLAIM",
        hide_env_values = true,
        default_value = "email",
        value_name = "CLAIM"
    )]
    user_claim: String,
    /// Time after which a user must sign in again, such as 30m or 12h
    #[arg(
        long = "oidc-session",
        env = "ROOST_OIDC_SESSION",
        hide_env_values = true,
        default_value = "12h",
        value_name = "TIME"
    )]
    session: String,
}

impl SignInArgs {
    /// The settings; none without the options.
    pub(crate) fn settings(self) -> Result<Option<SignInSettings>> {
        let session = interval::time(&self.session)
            .map_err(|allowed| format!("--oidc-session {:?} is not allowed: {allowed}", self.session));
        let options = SignInOptions {
            issuer: self.issuer,
            client_id: self.client_id,
            client_secret_file: self.client_secret_file,
            redirect: self.redirect,
            allow: self.allow.into_iter().filter(|rule| !rule.trim().is_empty()).collect(),
            groups_claim: self.groups_claim,
            user_claim: self.user_claim,
            session: session.clone().unwrap_or_default(),
        };
        let found = SignInSettings::of(&options);
        let faults: Vec<_> =
            found.as_ref().err().into_iter().flatten().chain(session.as_ref().err()).collect();
        if faults.is_empty() {
            return Ok(found.unwrap_or_default());
        }
        let lines: Vec<_> = faults.iter().map(|fault| format!("\n  {fault}")).collect();
        bail!("the options of sign-in have {} fault(s):{}", lines.len(), lines.concat())
    }
}
