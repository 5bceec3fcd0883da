//! A browser without scripts: it keeps the cookies of each site, and fills in the forms of the provider.

use std::collections::BTreeMap;

use reqwest::{Client, Method, Url, redirect};

use super::support::provider::PASSWORD;

/// An answer.
pub(crate) struct Page {
    pub(crate) status: u16,
    pub(crate) location: Option<String>,
    /// The headers `set-cookie`.
    pub(crate) cookies: Vec<String>,
    pub(crate) text: String,
}

/// A browser.
pub(crate) struct Visitor {
    http: Client,
    runtime: tokio::runtime::Runtime,
    /// Name and value by host and port.
    pub(crate) jar: BTreeMap<String, BTreeMap<String, String>>,
}

impl Visitor {
    pub(crate) fn new() -> Self {
        let http = Client::builder().redirect(redirect::Policy::none()).no_proxy();
        // Connections to a server that has ended are of no use.
        let http = http.pool_max_idle_per_host(0).build().unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        Self { http, runtime, jar: BTreeMap::new() }
    }

    pub(crate) fn get(&mut self, url: &str) -> Page {
        self.send(Method::GET, url, &[], None)
    }

    /// Sends a request with the cookies of its site.
    pub(crate) fn send(
        &mut self,
        method: Method,
        url: &str,
        headers: &[(&str, &str)],
        form: Option<&[(&str, &str)]>,
    ) -> Page {
        let site = Url::parse(url).unwrap().authority().to_owned();
        let jar = self.jar.entry(site).or_default();
        let cookies: Vec<_> = jar.iter().map(|(name, value)| format!("{name}={value}")).collect();
        let mut request = self.http.request(method, url).header("cookie", cookies.join("; "));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        if let Some(form) = form {
            let encoded = Url::parse_with_params("http://form/", form).unwrap();
            let body = encoded.query().unwrap().to_owned();
            request = request.header("content-type", "application/x-www-form-urlencoded").body(body);
        }
        let (answer, text) = self.runtime.block_on(async {
            let answer = request.send().await.unwrap();
            let (status, headers) = (answer.status().as_u16(), answer.headers().clone());
            ((status, headers), answer.text().await.unwrap())
        });
        let (status, headers) = answer;
        let text_of = |value: &reqwest::header::HeaderValue| value.to_str().unwrap().to_owned();
        let cookies: Vec<_> = headers.get_all("set-cookie").iter().map(text_of).collect();
        for cookie in &cookies {
            let (name, value) = cookie.split(';').next().unwrap().split_once('=').unwrap();
            match value {
                "" => drop(jar.remove(name)),
                value => drop(jar.insert(name.to_owned(), value.to_owned())),
            }
        }
        let location = headers.get("location").map(text_of);
        Page { status, location, cookies, text }
    }

    /// Follows redirects within one site.
    fn follow(&mut self, mut page: Page, from: &str) -> (Page, String) {
        let mut at = Url::parse(from).unwrap();
        while let Some(location) = &page.location {
            let next = at.join(location).unwrap();
            if next.authority() != at.authority() {
                break;
            }
            page = self.get(next.as_str());
            at = next;
        }
        (page, at.into())
    }

    /// Signs in at the provider, and answers its question. Returns the address that it sends the browser to.
    pub(crate) fn answer(&mut self, address: &str, user: &str, answer: &str) -> String {
        let page = self.get(address);
        let (mut page, mut at) = self.follow(page, address);
        for fields in [[("login", user)], [("password", PASSWORD)], [("answer", answer)]] {
            // The provider knows the user of a session, and asks once.
            if page.location.is_some() || !page.text.contains(&format!("name=\"{}\"", fields[0].0)) {
                continue;
            }
            let mark = "name=\"csrf_token\" value=\"";
            let (_, rest) = page.text.split_once(mark).unwrap_or_else(|| panic!("no form: {}", page.text));
            let token = rest.split('"').next().unwrap().to_owned();
            let sent = self.send(Method::POST, &at, &[], Some(&[("csrf_token", token.as_str()), fields[0]]));
            (page, at) = self.follow(sent, &at);
        }
        page.location.unwrap_or_else(|| panic!("the provider has answered {}: {}", page.status, page.text))
    }

    /// The value of a cookie of a site.
    pub(crate) fn cookie(&self, address: &str, name: &str) -> Option<String> {
        let site = Url::parse(address).unwrap().authority().to_owned();
        self.jar.get(&site)?.get(name).cloned()
    }
}
