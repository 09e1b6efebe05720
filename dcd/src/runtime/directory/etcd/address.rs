//! Parses where a world is kept in etcd: `etcd://HOST:PORT[,HOST:PORT...]/NAME`.

/// The members of an etcd cluster that are asked, and the name of the world there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct EtcdAddress {
    /// Each as `host:port`.
    pub(super) members: Vec<String>,
    pub(super) name: String,
}

const SCHEME: &str = "etcd://";
/// How an address is written.
pub(in crate::runtime) const WRITTEN: &str = "write etcd://HOST:PORT[,HOST:PORT...]/NAME, where HOST:PORT are members of an etcd cluster that \
     answer to clients over HTTP, and NAME, of letters, digits, - and _, is the world's";

impl EtcdAddress {
    /// Parses an address; `None` if it is none.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (members, name) = text.strip_prefix(SCHEME)?.split_once('/')?;
        let is_member = |member: &&str| {
            member.rsplit_once(':').is_some_and(|(host, port)| {
                !host.is_empty()
                    && host.chars().all(is_of_host)
                    && port.parse::<u16>().is_ok_and(|port| port > 0)
            })
        };
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
        let given: Vec<_> = members.split(',').collect();
        (is_name && given.iter().all(is_member))
            .then(|| Self { members: given.into_iter().map(str::to_owned).collect(), name: name.to_owned() })
    }
}

impl std::fmt::Display for EtcdAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{SCHEME}{}/{}", self.members.join(","), self.name)
    }
}

/// Returns whether a letter may be in a host's name, or in its address in figures: `[::1]`.
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
            "etcd://u@h:1/a",
            "etcd://h:70000/a",
        ] {
            assert_eq!(EtcdAddress::parse(wrong), None, "{wrong}");
        }
    }
}
