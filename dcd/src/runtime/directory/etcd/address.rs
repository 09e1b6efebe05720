//! Parses the address of a world in etcd, with how etcd is reached:
//! `etcd://HOST:PORT[,HOST:PORT...]/NAME[?OPTION=VALUE[&...]]`, or `etcds://` over TLS.

use std::path::PathBuf;

/// The members of an etcd cluster to ask, the name of the world there, and the credentials.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::runtime::directory) struct EtcdAddress {
    /// The members, each as `host:port`.
    pub(super) members: Vec<String>,
    pub(super) name: String,
    /// The files for TLS; `None` without TLS.
    pub(super) tls: Option<TlsFiles>,
    pub(super) user: Option<User>,
}

/// The files by which etcd and this server prove themselves to each other, in PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TlsFiles {
    /// The certificates of the authority that issued etcd's.
    pub(super) cacert: PathBuf,
    /// This server's certificate and its private key, if etcd asks for them.
    pub(super) client: Option<(PathBuf, PathBuf)>,
}

/// A user of etcd.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct User {
    pub(super) name: String,
    /// The file with the user's password; `None`: the password is in the environment.
    pub(super) password_file: Option<PathBuf>,
}

const PLAIN: &str = "etcd://";
const OVER_TLS: &str = "etcds://";

const WRITTEN: &str = "write etcd://HOST:PORT[,HOST:PORT...]/NAME, where HOST:PORT are members of an etcd cluster that \
     answer to clients over HTTP, and NAME, of letters, digits, - and _, is the world's; or etcds://...?cacert=FILE where they answer over TLS";
const OPTIONS: &str = "behind NAME and a ? write OPTION=VALUE, with & in between, each once: cacert, cert and key (files in PEM), user, password-file";
const NO_CACERT: &str = "etcds:// takes the certificate of etcd's authority, by which etcd is known: write etcds://.../NAME?cacert=FILE, the file \
     that etcdctl takes as --cacert";
const NO_TLS: &str =
    "cacert, cert and key are for TLS: write etcds:// where etcd answers over TLS, or leave them out";
const NO_PAIR: &str =
    "a certificate is of no use without its private key: write cert=FILE and key=FILE, or neither";
const NO_USER: &str = "a password is a user's: write user=NAME too";
const OPEN_PASSWORD: &str = "a password is not written there, where lists of processes show it: write user=NAME, and password-file=FILE or set the \
     environment's DCD_ETCD_PASSWORD; and change the one that you wrote";

impl EtcdAddress {
    /// Parses an address; an error says how to write one.
    pub(in crate::runtime::directory) fn parse(text: &str) -> Result<Self, &'static str> {
        let (place, options) = text.split_once('?').map_or((text, None), |(place, rest)| (place, Some(rest)));
        let (is_tls, rest) = match (place.strip_prefix(PLAIN), place.strip_prefix(OVER_TLS)) {
            (Some(rest), _) => (false, rest),
            (_, Some(rest)) => (true, rest),
            _ => return Err(WRITTEN),
        };
        if rest.contains('@') {
            return Err(OPEN_PASSWORD);
        }
        let (members, name) = rest.split_once('/').ok_or(WRITTEN)?;
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
        let members: Vec<_> = members.split(',').map(str::to_owned).collect();
        if !is_name || !members.iter().all(|member| is_member(member)) {
            return Err(WRITTEN);
        }
        let mut given = Options::parse(options)?;
        if given.take("password").is_some() {
            return Err(OPEN_PASSWORD);
        }
        let client = match (given.take("cert"), given.take("key")) {
            (Some(cert), Some(key)) => Some((cert.into(), key.into())),
            (None, None) => None,
            _ => return Err(NO_PAIR),
        };
        let tls = match (is_tls, given.take("cacert")) {
            (true, Some(cacert)) => Some(TlsFiles { cacert: cacert.into(), client }),
            (true, None) => return Err(NO_CACERT),
            (false, None) if client.is_none() => None,
            (false, _) => return Err(NO_TLS),
        };
        let user = match (given.take("user"), given.take("password-file").map(PathBuf::from)) {
            (Some(name), password_file) => Some(User { name: name.to_owned(), password_file }),
            (None, None) => None,
            (None, Some(_)) => return Err(NO_USER),
        };
        if !given.0.is_empty() {
            return Err(OPTIONS);
        }
        Ok(Self { members, name: name.to_owned(), tls, user })
    }

    /// Returns what may be shown of an address, even of a wrong one: no options, and nothing before an @.
    pub(in crate::runtime::directory) fn shown(text: &str) -> &str {
        let place = |text| str::split_once(text, '?').map_or(text, |(place, _)| place);
        let members = place(text).split_once("://").and_then(|(_, rest)| rest.split_once('/'));
        if members.is_some_and(|(members, _)| members.split(',').all(is_member)) {
            return place(text);
        }
        // A password may contain a ?.
        place(text.rsplit_once('@').map_or(text, |(_, rest)| rest))
    }

    /// Returns the scheme of the members' URLs.
    pub(super) fn scheme(&self) -> &'static str {
        if self.tls.is_some() { "https" } else { "http" }
    }
}

/// The options that are not taken yet.
struct Options<'a>(Vec<(&'a str, &'a str)>);

impl<'a> Options<'a> {
    fn parse(text: Option<&'a str>) -> Result<Self, &'static str> {
        let pairs = text.into_iter().flat_map(|text| text.split('&'));
        let pairs =
            pairs.map(|pair| pair.split_once('=').filter(|(_, value)| !value.is_empty()).ok_or(OPTIONS));
        pairs.collect::<Result<_, _>>().map(Self)
    }

    /// Takes an option out. A second one of the same name is left, which is an error.
    fn take(&mut self, name: &str) -> Option<&'a str> {
        let at = self.0.iter().position(|(given, _)| *given == name)?;
        Some(self.0.remove(at).1)
    }
}

/// Without the options, since people read it.
impl std::fmt::Display for EtcdAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let scheme = if self.tls.is_some() { OVER_TLS } else { PLAIN };
        write!(f, "{scheme}{}/{}", self.members.join(","), self.name)
    }
}

fn is_member(member: &str) -> bool {
    member.rsplit_once(':').is_some_and(|(host, port)| {
        !host.is_empty() && host.chars().all(is_of_host) && port.parse::<u16>().is_ok_and(|port| port > 0)
    })
}

/// Returns whether a character may be part of a host name or of a numeric address: `[::1]`.
fn is_of_host(c: char) -> bool {
    c.is_ascii_alphanumeric() || "-._[]:".contains(c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_names_members_and_a_world() {
        let text = "etcd://10.0.0.1:2379,etcd-2.example:2379,[::1]:2379/play-1";
        let address = EtcdAddress::parse(text).unwrap();
        assert_eq!((address.members.len(), address.name.as_str()), (3, "play-1"));
        assert_eq!(address.to_string(), text);
        for wrong in [
            "",
            "etcd://",
            "etcd:///a",
            "etcd://h:1",
            "etcd://h:1/",
            "etcd://h/a",
            "etcd://h:0/a",
            "etcd://h:1,/a",
            "etcd://h:1/a/b",
            "etcd://h:1/a b",
            "http://h:1/a",
            "etcd://h:70000/a",
            "etcds://h/a?cacert=c",
        ] {
            assert_eq!(EtcdAddress::parse(wrong), Err(WRITTEN), "{wrong}");
        }
    }

    #[test]
    fn options_say_how_etcd_is_known_and_who_asks() {
        let text =
            "etcds://h:1,i:2/a?cacert=/etc/ca.pem&cert=c=1.pem&key=k.pem&user=dcd&password-file=/run/pw";
        let address = EtcdAddress::parse(text).unwrap();
        let tls = address.tls.as_ref().unwrap();
        assert_eq!(tls.cacert.to_str(), Some("/etc/ca.pem"));
        assert_eq!(tls.client, Some(("c=1.pem".into(), "k.pem".into())));
        let user = address.user.as_ref().unwrap();
        assert_eq!((user.name.as_str(), &user.password_file), ("dcd", &Some("/run/pw".into())));
        assert_eq!((address.to_string().as_str(), address.scheme()), ("etcds://h:1,i:2/a", "https"));
        let plain = EtcdAddress::parse("etcd://h:1/a?user=dcd").unwrap();
        assert_eq!((plain.user.unwrap().password_file, plain.tls), (None, None));
        for (wrong, why) in [
            ("etcds://h:1/a", NO_CACERT),
            ("etcds://h:1/a?user=u", NO_CACERT),
            ("etcds://h:1/a?cacert=c&cert=c", NO_PAIR),
            ("etcds://h:1/a?cacert=c&key=k", NO_PAIR),
            ("etcd://h:1/a?cacert=c", NO_TLS),
            ("etcd://h:1/a?cert=c&key=k", NO_TLS),
            ("etcd://h:1/a?password-file=f", NO_USER),
            ("etcd://h:1/a?user=u&password=secret", OPEN_PASSWORD),
            ("etcds://h:1/a?password=secret", OPEN_PASSWORD),
            ("etcd://u:secret@h:1/a", OPEN_PASSWORD),
            ("etcd://h:1/a?", OPTIONS),
            ("etcd://h:1/a?user", OPTIONS),
            ("etcd://h:1/a?user=", OPTIONS),
            ("etcd://h:1/a?user=u&user=v", OPTIONS),
            ("etcd://h:1/a?timeout=3", OPTIONS),
        ] {
            assert_eq!(EtcdAddress::parse(wrong), Err(why), "{wrong}");
            assert!(!EtcdAddress::shown(wrong).contains("secret"), "{wrong}");
        }
        assert_eq!(EtcdAddress::shown("etcd://u:sec?ret@h:1/a?user=u"), "h:1/a");
        assert_eq!(EtcdAddress::shown("etcds://h:1/a?cacert=/etc/ca@home.pem"), "etcds://h:1/a");
    }
}
