//! Starts real etcd clusters on this machine, open or with TLS and users, and kills and stops their members.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use data_encoding::BASE64;
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer,
    KeyPair, KeyUsagePurpose, date_time_ymd,
};
use serde_json::{Value, json};

/// How long a cluster may take to elect its first leader.
const LIMIT: Duration = Duration::from_secs(30);
/// The password of root, who may do everything.
const ROOT_PASSWORD: &str = "of root";

/// A running cluster. Dropping it ends the cluster.
pub struct EtcdCluster {
    members: Vec<Member>,
    /// The end of a world's address: the files that a client needs for TLS. Empty without TLS.
    options: String,
    authority: Option<Authority>,
    folder: tempfile::TempDir,
}

struct Member {
    child: Child,
    client: SocketAddr,
    /// The address on which the member answers without TLS.
    open: SocketAddr,
}

/// The kind of a certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Certified {
    /// The certificate names this machine.
    Well,
    /// The certificate names another machine.
    Elsewhere,
    /// The certificate has expired.
    Expired,
    /// The certificate names this machine and also has a common name. etcd's gateway refuses such clients
    /// where there are users.
    Named,
}

/// A certificate authority, which writes its certificates into a folder.
pub struct Authority {
    folder: PathBuf,
    name: String,
    issuer: Issuer<'static, KeyPair>,
}

impl EtcdCluster {
    /// Starts a cluster that lets everybody in. Returns `None` where etcd is not installed.
    #[must_use]
    pub fn start(members: usize) -> Option<Self> {
        Self::start_any(&vec![None; members], &[])
    }

    /// Starts one member that has room for so many bytes.
    #[must_use]
    pub fn start_small(bytes: u32) -> Option<Self> {
        Self::start_any(&[None], &["--quota-backend-bytes", &bytes.to_string()])
    }

    /// Starts a cluster that answers over TLS, to clients with a certificate of its authority. Each member
    /// has a certificate of the given kind. `options` are passed to each member.
    #[must_use]
    pub fn start_over_tls(members: &[Certified], options: &[&str]) -> Option<Self> {
        let members: Vec<_> = members.iter().copied().map(Some).collect();
        Self::start_any(&members, options)
    }

    fn start_any(members: &[Option<Certified>], options: &[&str]) -> Option<Self> {
        if Command::new("etcd").arg("--version").stdout(Stdio::null()).status().is_err() {
            println!("note: etcd is missing (apt-get install etcd-server); not tried");
            return None;
        }
        // Another process may take a port that was free a moment ago.
        (0..5).find_map(|_| Self::try_start(members, options)).or_else(|| panic!("etcd does not start"))
    }

    fn try_start(certified: &[Option<Certified>], options: &[&str]) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let count = certified.len();
        let is_open = certified.iter().all(Option::is_none);
        let authority = (!is_open).then(|| Authority::new(folder.path(), "authority"));
        let options_of_clients =
            authority.as_ref().map(|authority| authority.options(Certified::Well)).unwrap_or_default();
        let free: Vec<_> = (0..3 * count).map(|_| TcpListener::bind("127.0.0.1:0").unwrap()).collect();
        let ports: Vec<_> = free.iter().map(|port| port.local_addr().unwrap()).collect();
        drop(free);
        let peers: Vec<_> = (0..count).map(|i| format!("m{i}=http://{}", ports[3 * i + 1])).collect();
        let members = certified.iter().enumerate().map(|(i, certified)| {
            let (client, peer) = (ports[3 * i], format!("http://{}", ports[3 * i + 1]));
            let open = if certified.is_some() { ports[3 * i + 2] } else { client };
            let url =
                if certified.is_some() { format!("https://{client}") } else { format!("http://{client}") };
            let urls = if certified.is_some() { format!("{url},http://{open}") } else { url.clone() };
            let name = format!("m{i}");
            let mut command = Command::new("etcd");
            command
                .args(["--name", &name, "--initial-cluster", &peers.join(","), "--logger", "zap"])
                .args(["--listen-client-urls", &urls, "--advertise-client-urls", &url])
                .args(["--listen-peer-urls", &peer, "--initial-advertise-peer-urls", &peer])
                .args(["--bcrypt-cost", "4"])
                .args(options)
                .arg("--data-dir")
                .arg(folder.path().join(&name));
            if let (Some(certified), Some(authority)) = (certified, &authority) {
                let (cert, key) = authority.issue(&name, *certified);
                command.arg("--client-cert-auth").arg("--trusted-ca-file").arg(authority.certificate());
                command.arg("--cert-file").arg(cert).arg("--key-file").arg(key);
            }
            let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
            Member { child, client, open }
        });
        let members = members.collect();
        let mut cluster = Self { members, options: options_of_clients, authority, folder };
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

    /// Returns the address of a world of this name in the cluster, with all options that a client needs to
    /// reach it, except a user.
    #[must_use]
    pub fn place(&self, name: &str) -> String {
        let members: Vec<_> = self.members.iter().map(|member| member.client.to_string()).collect();
        let scheme = if self.options.is_empty() { "etcd" } else { "etcds" };
        format!("{scheme}://{}/{name}{}", members.join(","), self.options)
    }

    /// Returns the options that follow the name in that address.
    #[must_use]
    pub fn options(&self) -> &str {
        &self.options
    }

    /// Issues a certificate of the cluster's authority; see [`Authority::issue`].
    #[must_use]
    pub fn issue(&self, name: &str, certified: Certified) -> (PathBuf, PathBuf) {
        self.authority.as_ref().expect("it has TLS").issue(name, certified)
    }

    /// Returns the address of a member, as `host:port`.
    #[must_use]
    pub fn member(&self, member: usize) -> String {
        self.members[member].client.to_string()
    }

    /// Returns the address at which a member answers without TLS, as `host:port`.
    #[must_use]
    pub fn open_member(&self, member: usize) -> String {
        self.members[member].open.to_string()
    }

    /// Returns a folder that is removed with the cluster.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Creates a user with this password who may read and write all keys that begin with `prefix`.
    pub fn add_user(&self, name: &str, password: &str, prefix: &str) {
        self.administer("user/add", &json!({ "name": name, "password": password }));
        let end =
            [&prefix.as_bytes()[..prefix.len() - 1], &[prefix.as_bytes()[prefix.len() - 1] + 1]].concat();
        let (key, range_end) = (BASE64.encode(prefix.as_bytes()), BASE64.encode(&end));
        let permission = json!({ "permType": "READWRITE", "key": key, "range_end": range_end });
        self.administer("role/add", &json!({ "name": name }));
        self.administer("role/grant", &json!({ "name": name, "perm": permission }));
        self.administer("user/grant", &json!({ "user": name, "role": name }));
    }

    /// Turns authentication on: from now on only users are let in.
    pub fn enable_users(&self) {
        self.administer("user/add", &json!({ "name": "root", "password": ROOT_PASSWORD }));
        self.administer("user/grant", &json!({ "user": "root", "role": "root" }));
        self.administer("enable", &json!({}));
    }

    /// Changes a user's password, which makes the user's tokens invalid.
    pub fn change_password(&self, name: &str, password: &str) {
        self.administer("user/changepw", &json!({ "name": name, "password": password }));
    }

    /// Sends an administrative request to the first member, as root if the cluster has users.
    fn administer(&self, what: &str, body: &Value) {
        let root = json!({ "name": "root", "password": ROOT_PASSWORD });
        let token = self.post("authenticate", None, &root).ok().and_then(|answer| {
            let answer: Value = serde_json::from_str(&answer).ok()?;
            Some(answer["token"].as_str()?.to_owned())
        });
        self.post(what, token.as_deref(), body).unwrap_or_else(|error| panic!("{what}: {error}"));
    }

    fn post(&self, what: &str, token: Option<&str>, body: &Value) -> Result<String, String> {
        let body = body.to_string();
        let token = token.map(|token| format!("Authorization: {token}\r\n")).unwrap_or_default();
        let head = format!("POST /v3/auth/{what} HTTP/1.0\r\n{token}Content-Length: {}\r\n\r\n", body.len());
        let answer = self.members[0].ask(&(head + &body)).map_err(|error| error.to_string())?;
        let is_done = answer.split_whitespace().nth(1) == Some("200");
        let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body).to_owned();
        if is_done { Ok(body) } else { Err(answer) }
    }

    /// Kills a member, as a crash would.
    pub fn kill(&mut self, member: usize) {
        let _ = self.members[member].child.kill();
        let _ = self.members[member].child.wait();
    }

    /// Sends a signal to a member, by its name for `kill`.
    pub fn signal(&self, member: usize, name: &str) {
        let id = self.members[member].child.id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
    }
}

impl Member {
    fn is_healthy(&self) -> bool {
        self.ask("GET /health HTTP/1.0\r\n\r\n").is_ok_and(|answer| answer.contains("\"health\":\"true\""))
    }

    fn ask(&self, request: &str) -> std::io::Result<String> {
        let mut stream = TcpStream::connect(self.open)?;
        stream.set_read_timeout(Some(Duration::from_secs(2)))?;
        stream.write_all(request.as_bytes())?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer)?;
        Ok(answer)
    }
}

impl Drop for EtcdCluster {
    fn drop(&mut self) {
        (0..self.members.len()).for_each(|member| self.kill(member));
    }
}

impl Authority {
    /// Creates an authority, and writes its certificate into the folder.
    #[must_use]
    pub fn new(folder: &Path, name: &str) -> Self {
        let mut params = CertificateParams::default();
        params.distinguished_name.push(DnType::CommonName, name);
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
        let key = KeyPair::generate().unwrap();
        let certificate = params.self_signed(&key).unwrap();
        let authority =
            Self { folder: folder.to_owned(), name: name.to_owned(), issuer: Issuer::new(params, key) };
        write_pem(&authority.certificate(), "CERTIFICATE", certificate.der());
        authority
    }

    /// Returns the file of the authority's certificate.
    #[must_use]
    pub fn certificate(&self) -> PathBuf {
        self.folder.join(format!("{}.pem", self.name))
    }

    /// Issues a certificate for a client, and returns the options by which a world's address names that
    /// certificate and this authority.
    #[must_use]
    pub fn options(&self, certified: Certified) -> String {
        let (cert, key) = self.issue("client", certified);
        let cacert = self.certificate();
        format!("?cacert={}&cert={}&key={}", cacert.display(), cert.display(), key.display())
    }

    /// Issues a certificate for a server and client of this name. Returns its file and the file of its
    /// private key.
    #[must_use]
    pub fn issue(&self, name: &str, certified: Certified) -> (PathBuf, PathBuf) {
        let host = if certified == Certified::Elsewhere { "elsewhere.example" } else { "127.0.0.1" };
        let mut params = CertificateParams::new([host.to_owned()]).unwrap();
        params.distinguished_name = DistinguishedName::new();
        let subject =
            if certified == Certified::Named { DnType::CommonName } else { DnType::OrganizationName };
        params.distinguished_name.push(subject, name);
        params.extended_key_usages =
            vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
        if certified == Certified::Expired {
            params.not_after = date_time_ymd(2001, 1, 1);
        }
        let key = KeyPair::generate().unwrap();
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        let file = |what: &str| self.folder.join(format!("{}-{name}{what}.pem", self.name));
        write_pem(&file(""), "CERTIFICATE", certificate.der());
        write_pem(&file("-key"), "PRIVATE KEY", &key.serialize_der());
        (file(""), file("-key"))
    }
}

fn write_pem(path: &Path, label: &str, der: &[u8]) {
    let text = BASE64.encode(der);
    let lines: Vec<_> = text.as_bytes().chunks(64).map(String::from_utf8_lossy).collect();
    let pem = format!("-----BEGIN {label}-----\n{}\n-----END {label}-----\n", lines.join("\n"));
    std::fs::write(path, pem).unwrap();
}
