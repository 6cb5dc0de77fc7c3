//! Who may see the page: those who know its token, from a page of this server.

use std::net::SocketAddr;

use crate::error::{Error, Result};

/// Bytes of a token: too many to be guessed.
const TOKEN_BYTES: usize = 16;

/// The address of the page with its secret.
#[derive(Clone, Debug)]
pub struct Guard {
    address: SocketAddr,
    token: String,
    nonce: String,
}

/// What a request is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The page.
    Page,
    /// The socket of the page.
    Socket,
}

impl Guard {
    /// A new token for a server at this address.
    ///
    /// # Errors
    /// [`Error::Numerical`] where the system has no random numbers.
    pub fn new(address: SocketAddr) -> Result<Self> {
        Ok(Self { address, token: random()?, nonce: random()? })
    }

    /// The address to open.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// The mark of the scripts that the page may run.
    pub fn nonce(&self) -> &str {
        &self.nonce
    }

    /// What a path asks for; `None` without the token.
    pub fn place(&self, path: &str) -> Option<Place> {
        let (token, rest) = path.strip_prefix('/')?.split_once('/')?;
        // Every byte is compared, so that the time tells nothing.
        let differs = token.bytes().zip(self.token.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
        if token.len() != self.token.len() || differs != 0 {
            return None;
        }
        match rest {
            "" => Some(Place::Page),
            "socket" => Some(Place::Socket),
            _ => None,
        }
    }

    /// Whether a request names this machine or the address that is listened on. Other names may belong to somebody else's page, whose name
    /// was made to point here.
    pub fn knows_host(&self, host: &str) -> bool {
        let name =
            host.rsplit_once(':').map_or(host, |(name, port)| if port.ends_with(']') { host } else { name });
        let name = name.trim_start_matches('[').trim_end_matches(']');
        let is_here = name.parse::<std::net::IpAddr>().is_ok_and(|ip| {
            ip.is_loopback() || ip == self.address.ip() || self.address.ip().is_unspecified()
        });
        is_here || name.eq_ignore_ascii_case("localhost")
    }

    /// Whether a socket was opened by a page of this server: its origin is the host that it asks.
    pub fn knows_origin(&self, origin: Option<&str>, host: &str) -> bool {
        origin
            .and_then(|origin| origin.strip_prefix("http://"))
            .is_some_and(|from| from.eq_ignore_ascii_case(host))
    }
}

fn random() -> Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes).map_err(|error| {
        Error::Numerical(format!("the system has no random numbers for a token: {error}"))
    })?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_token_opens_the_page_and_only_its_own_page_the_socket() -> Result<()> {
        let guard = Guard::new(SocketAddr::from(([127, 0, 0, 1], 8123)))?;
        let url = guard.url();
        let path = url.strip_prefix("http://127.0.0.1:8123").unwrap_or_default();
        assert_eq!(guard.place(path), Some(Place::Page));
        assert_eq!(guard.place(&format!("{path}socket")), Some(Place::Socket));
        for wrong in ["/", "", "/token/", "/0123/socket", &path[..path.len() - 2], &format!("{path}run.json")]
        {
            assert_eq!(guard.place(wrong), None, "{wrong}");
        }
        let hosts = ["127.0.0.1:8123", "localhost:9000", "[::1]:9000", "localhost"];
        assert!(hosts.iter().all(|host| guard.knows_host(host)));
        assert!(!guard.knows_host("evil.example:8123") && !guard.knows_host("192.168.1.7:8123"));
        assert!(guard.knows_origin(Some("http://localhost:9000"), "localhost:9000"));
        for origin in [None, Some("null"), Some("http://evil.example"), Some("https://localhost:9000")] {
            assert!(!guard.knows_origin(origin, "localhost:9000"), "{origin:?}");
        }
        assert_ne!(guard.token, Guard::new(guard.address)?.token);
        Ok(())
    }
}
