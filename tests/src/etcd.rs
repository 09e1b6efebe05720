//! Starts real etcd clusters on this machine, and kills and stops their members.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How long a cluster may take to elect its first leader.
const LIMIT: Duration = Duration::from_secs(30);

/// A running cluster, which ends when dropped.
pub struct EtcdCluster {
    members: Vec<Member>,
    _folder: tempfile::TempDir,
}

struct Member {
    child: Child,
    client: SocketAddr,
}

impl EtcdCluster {
    /// Starts a cluster; `None` where there is no etcd.
    #[must_use]
    pub fn start(members: usize) -> Option<Self> {
        if Command::new("etcd").arg("--version").stdout(Stdio::null()).status().is_err() {
            println!("note: etcd is missing (apt-get install etcd-server); not tried");
            return None;
        }
        // Another process may take a port that was just free.
        (0..5).find_map(|_| Self::try_start(members)).or_else(|| panic!("etcd does not start"))
    }

    fn try_start(count: usize) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let free: Vec<_> = (0..2 * count).map(|_| TcpListener::bind("127.0.0.1:0").unwrap()).collect();
        let ports: Vec<_> = free.iter().map(|port| port.local_addr().unwrap()).collect();
        drop(free);
        let peers: Vec<_> = (0..count).map(|i| format!("m{i}=http://{}", ports[2 * i + 1])).collect();
        let members = (0..count).map(|i| {
            let (client, peer) = (ports[2 * i], format!("http://{}", ports[2 * i + 1]));
            let url = format!("http://{client}");
            let name = format!("m{i}");
            let child = Command::new("etcd")
                .args(["--name", &name, "--initial-cluster", &peers.join(","), "--logger", "zap"])
                .args(["--listen-client-urls", &url, "--advertise-client-urls", &url])
                .args(["--listen-peer-urls", &peer, "--initial-advertise-peer-urls", &peer])
                .arg("--data-dir")
                .arg(folder.path().join(&name))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            Member { child, client }
        });
        let mut cluster = Self { members: members.collect(), _folder: folder };
        let start = Instant::now();
        while !cluster.members.iter().all(|member| member.is_healthy()) {
            if cluster.members.iter_mut().any(|member| member.child.try_wait().unwrap().is_some()) {
                return None;
            }
            assert!(start.elapsed() < LIMIT, "etcd elects no leader");
            std::thread::sleep(Duration::from_millis(20));
        }
        Some(cluster)
    }

    /// Where a world of this name is kept in it.
    #[must_use]
    pub fn place(&self, name: &str) -> String {
        let members: Vec<_> = self.members.iter().map(|member| member.client.to_string()).collect();
        format!("etcd://{}/{name}", members.join(","))
    }

    /// What a crash of a member does.
    pub fn kill(&mut self, member: usize) {
        let _ = self.members[member].child.kill();
        let _ = self.members[member].child.wait();
    }

    /// Sends a signal to a member, as `kill` names it.
    pub fn signal(&self, member: usize, name: &str) {
        let id = self.members[member].child.id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
    }
}

impl Member {
    fn is_healthy(&self) -> bool {
        let ask = || -> std::io::Result<String> {
            let mut stream = TcpStream::connect(self.client)?;
            stream.set_read_timeout(Some(Duration::from_secs(2)))?;
            stream.write_all(b"GET /health HTTP/1.0\r\n\r\n")?;
            let mut answer = String::new();
            stream.read_to_string(&mut answer)?;
            Ok(answer)
        };
        ask().is_ok_and(|answer| answer.contains("\"health\":\"true\""))
    }
}

impl Drop for EtcdCluster {
    fn drop(&mut self) {
        (0..self.members.len()).for_each(|member| self.kill(member));
    }
}
