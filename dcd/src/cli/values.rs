//! Parses values that several subcommands take.

use std::net::{IpAddr, SocketAddr, ToSocketAddrs};
use std::path::Path;
use std::time::Duration;

use super::failure::Failure;
use crate::cluster::directory::DirectoryError;
use crate::runtime::{JoinConfig, is_there};

/// Default address of servers.
pub(super) const SERVER: &str = "127.0.0.1:7420";

/// Parses an address with its port; names are looked up.
pub(super) fn address(text: &str) -> Result<SocketAddr, String> {
    if let Ok(address) = text.parse() {
        return Ok(address);
    }
    if !text.contains(':') {
        let is_port = text.parse::<u16>().is_ok();
        let whole = if is_port { format!("127.0.0.1:{text}") } else { format!("{text}:7420") };
        return Err(format!("write address and port, as {whole}"));
    }
    let found = text.to_socket_addrs().map_err(|error| {
        format!("`{text}` is no address ({error}); write one with its port, as 192.0.2.7:7420")
    })?;
    // Most servers listen on IPv4 when a name has both.
    let mut found: Vec<_> = found.collect();
    found.sort_by_key(SocketAddr::is_ipv6);
    found.first().copied().ok_or_else(|| format!("`{text}` has no address; write it as numbers"))
}

/// Returns an address at which others can reach this process.
pub(super) fn reachable(text: &str) -> Result<SocketAddr, String> {
    let found = address(text)?;
    let ip = found.ip();
    let is_broadcast = matches!(ip, IpAddr::V4(ip) if ip.is_broadcast());
    if found.port() == 0 || ip.is_unspecified() || ip.is_multicast() || is_broadcast {
        return Err(format!(
            "nobody reaches a process at {found}; write one address of this machine, with its port, as others see it"
        ));
    }
    Ok(found)
}

/// Returns the configuration to join a server that is at one of these addresses.
pub(super) fn joining(servers: &[SocketAddr], token: impl Into<String>) -> JoinConfig {
    JoinConfig { standbys: servers[1..].to_vec(), ..JoinConfig::new(servers[0], token) }
}

/// Parses a time with its unit: 90s, 10m, 2h, 1d.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || "write a time with its unit, from 1s to 365d: 90s, 10m, 2h or 1d".to_owned();
    let unit = text.chars().next_back().ok_or_else(wrong)?;
    let unit_s = match unit {
        's' => 1,
        'm' => 60,
        'h' => 3600,
        'd' => 24 * 3600,
        _ => return Err(wrong()),
    };
    let count: u64 = text[..text.len() - 1].parse().map_err(|_| wrong())?;
    match count.checked_mul(unit_s) {
        Some(seconds) if (1..=365 * 24 * 3600).contains(&seconds) => Ok(Duration::from_secs(seconds)),
        _ => Err(wrong()),
    }
}

/// Parses seconds of real time, at most a year.
pub(super) fn wall_seconds(text: &str) -> Result<Duration, String> {
    let wrong = || "write seconds above 0 and up to a year, as 10 or 0.5".to_owned();
    let value: f64 = text.parse().map_err(|_| wrong())?;
    if value > 0.0 && value <= 366.0 * 24.0 * 3600.0 {
        Ok(Duration::from_secs_f64(value))
    } else {
        Err(wrong())
    }
}

/// Parses metres per second, above 0.
pub(super) fn speed(text: &str) -> Result<f32, String> {
    let wrong = || "write metres per second, above 0 and up to 100000".to_owned();
    let value: f32 = text.parse().map_err(|_| wrong())?;
    if value > 0.0 && value <= 1e5 { Ok(value) } else { Err(wrong()) }
}

/// Parses a share, from 0 to 1.
pub(super) fn share(text: &str) -> Result<f64, String> {
    let wrong = || "write a share from 0 to 1, as 0.01 for one of a hundred".to_owned();
    let value: f64 = text.parse().map_err(|_| wrong())?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err(wrong()) }
}

/// Parses a positive number: milliseconds or metres.
pub(super) fn positive(text: &str) -> Result<f32, String> {
    let wrong = || "write a number above 0 and up to 100000".to_owned();
    let value: f32 = text.parse().map_err(|_| wrong())?;
    if value > 0.0 && value <= 1e5 { Ok(value) } else { Err(wrong()) }
}

/// The remedy where a data folder is another user's.
pub(super) const AS_SERVERS_USER: &str = "ask as the user that the server runs as: runuser -u dcd -- dcd ...";

/// Returns whether a server has used a data folder.
pub(super) fn is_used(data: &Path) -> Result<bool, Failure> {
    is_there(&data.join("authority.pem")).map_err(|error| of_folder(&error))
}

/// Returns a path as a shell reads it, in quotes where it needs them.
pub(super) fn shell_word(path: &Path) -> String {
    let path = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "_./-+,:@%=".contains(c);
    match path.chars().all(is_plain) && !path.is_empty() {
        true => path,
        false => format!("'{}'", path.replace('\'', r"'\''")),
    }
}

/// Returns the failure of a command whose data folder cannot be used: it may be another user's.
pub(super) fn of_folder(error: &DirectoryError) -> Failure {
    Failure::usage(format!("{error}; {AS_SERVERS_USER}"))
}

/// Returns the failure of a command beside a server that stands by.
pub(super) fn stands_by(data: &Path) -> Failure {
    Failure::usage(format!(
        "the server of {} stands by, and another one has the world; ask beside that one, which the log of this one names",
        data.display()
    ))
}

/// Checks that a new recording overwrites nothing: the file must not exist, or be empty.
pub(super) fn unused(path: &Path) -> Result<(), Failure> {
    if path.metadata().is_ok_and(|file| file.len() > 0) {
        return Err(Failure::usage(format!(
            "{} is there already, perhaps the recording of what went wrong; move it, or record to another file",
            path.display()
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_that_a_shell_would_read_otherwise_is_quoted() {
        let words = ["/var/lib/dcd", "my data", "it's", "ö", "$(x)"].map(|path| shell_word(Path::new(path)));
        assert_eq!(words, ["/var/lib/dcd", "'my data'", r"'it'\''s'", "ö", "'$(x)'"]);
    }

    #[test]
    fn times_have_a_unit() {
        assert_eq!(duration("90s"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("10m"), Ok(Duration::from_secs(600)));
        assert_eq!(duration("365d"), Ok(Duration::from_secs(365 * 86_400)));
        for wrong in ["", "10", "m", "0s", "366d", "-1s", "1.5h", "10 m", "99999999999999999999d", "1\u{e9}"]
        {
            assert!(duration(wrong).unwrap_err().contains("90s"), "{wrong}");
        }
    }

    #[test]
    fn addresses_have_a_port_and_names_are_looked_up() {
        assert_eq!(address("192.0.2.7:1"), Ok("192.0.2.7:1".parse().unwrap()));
        assert_eq!(address("[::1]:1"), Ok("[::1]:1".parse().unwrap()));
        assert_eq!(address("localhost:9").unwrap().port(), 9);
        assert!(address("192.0.2.7").unwrap_err().contains("192.0.2.7:7420"));
        assert!(address("192.0.2.7:port").unwrap_err().contains("is no address"));
    }

    #[test]
    fn what_is_advertised_names_one_process() {
        assert_eq!(reachable("192.0.2.7:1"), address("192.0.2.7:1"));
        for wrong in ["0.0.0.0:5", "[::]:5", "192.0.2.7:0", "255.255.255.255:5", "224.0.0.1:5", "[ff02::1]:5"]
        {
            assert!(reachable(wrong).unwrap_err().contains("nobody reaches"), "{wrong}");
        }
        assert!(reachable("192.0.2.7").unwrap_err().contains("192.0.2.7:7420"));
    }

    #[test]
    fn numbers_have_a_range() {
        assert!(wall_seconds("0.5").is_ok() && speed("5").is_ok());
        for wrong in ["0", "-1", "nan", "inf", "x"] {
            assert!(wall_seconds(wrong).is_err() && speed(wrong).is_err(), "{wrong}");
        }
    }
}
