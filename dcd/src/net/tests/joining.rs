//! Tests tokens, joins and identities.

use std::time::Instant;

use rustls::pki_types::CertificateDer;

use super::*;
use crate::net::join::{JoinRequest, exchange};
use crate::net::key::Key;
use crate::net::renewal_request::RenewalRequest;
use crate::net::token::unix_seconds;
use crate::space::{ClientId, NodeId};

fn refusal(result: Result<Identity, NetError>) -> String {
    match result {
        Err(NetError::Refused { reason, .. } | NetError::TokenRefused { reason, .. }) => reason,
        other => panic!("expected a refusal, got {other:?}"),
    }
}

/// Returns the server's answer to a hand-made request.
fn reply(server: &Server, request: &[u8]) -> String {
    let fingerprint = server.token(JoinRole::Node).fingerprint;
    let (_, reply) = exchange(&[server.addr()], fingerprint, request, PATIENCE).unwrap();
    assert_ne!(reply[0], 1, "a refusal");
    String::from_utf8(reply[1..].to_vec()).unwrap()
}

#[test]
fn ids_are_counted_from_one_and_a_participant_gets_one_of_each() {
    let server = Server::start();
    assert_eq!(server.join(JoinRole::Node).who(), PeerName::Node(NodeId(1)));
    assert_eq!(server.join(JoinRole::Client).who(), PeerName::Client(ClientId(1)));
    let both = server.join(JoinRole::Participant);
    assert_eq!(
        (both.role(), both.node(), both.client()),
        (JoinRole::Participant, Some(NodeId(2)), Some(ClientId(2)))
    );
    assert_eq!(server.process.net.totals().joins_granted, 3);
}

#[test]
fn a_token_lets_one_process_in_even_when_the_server_starts_again() {
    let Server { process, authority, folder } = Server::start();
    let mint = || authority.issue_token(JoinRole::Node, HOUR, SystemTime::now()).unwrap();
    let (used, unused) = (mint(), mint());
    join(&[process.net.local_addr()], &used, None, PATIENCE).unwrap();
    let again = refusal(join(&[process.net.local_addr()], &used, None, PATIENCE));
    assert!(again.contains("used already"), "{again}");
    assert_eq!(process.net.totals().joins_refused, 1);

    drop((process, authority));
    let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
    let identity = authority.server_identity().unwrap();
    let process = Process::start(identity, Some(authority), Limits::default());
    let again = refusal(join(&[process.net.local_addr()], &used, None, PATIENCE));
    assert!(again.contains("used already"), "{again}");
    let second = join(&[process.net.local_addr()], &unused, None, PATIENCE).unwrap();
    assert_eq!(second.who(), PeerName::Node(NodeId(2)), "ids go on where they were");
}

#[test]
fn of_many_that_bring_the_same_token_at_once_one_gets_in() {
    let server = Server::start();
    let (addr, token) = (server.addr(), server.token(JoinRole::Client));
    let let_in = std::thread::scope(|scope| {
        let joins: Vec<_> =
            (0..6).map(|_| scope.spawn(|| join(&[addr], &token, None, PATIENCE).is_ok())).collect();
        joins.into_iter().map(|join| join.join().unwrap()).filter(|let_in| *let_in).count()
    });
    assert_eq!(let_in, 1);
}

#[test]
fn tokens_are_minted_by_another_process_while_the_server_runs() {
    let server = Server::start();
    let other = Authority::load_or_create(server.folder.path()).unwrap();
    let token = other.issue_token(JoinRole::Client, HOUR, SystemTime::now()).unwrap();
    join(&[server.addr()], &token.to_string().parse().unwrap(), None, PATIENCE).unwrap();
    assert!(matches!(
        other.issue_token(JoinRole::Server, HOUR, SystemTime::now()),
        Err(NetError::ServerToken)
    ));
}

#[test]
fn an_expired_token_is_refused() {
    let server = Server::start();
    let then = SystemTime::now() - 2 * HOUR;
    let token = server.authority.issue_token(JoinRole::Node, HOUR, then).unwrap();
    let reason = refusal(join(&[server.addr()], &token, None, PATIENCE));
    assert!(reason.contains("expired"), "{reason}");
}

#[test]
fn a_joiner_does_not_talk_to_a_server_of_another_authority() {
    let (server, foreign) = (Server::start(), Server::start());
    let result = join(&[server.addr()], &foreign.token(JoinRole::Node), None, PATIENCE);
    let Err(error @ NetError::WrongPeer { .. }) = result else { panic!("{result:?}") };
    assert!(error.to_string().contains("not the one that the token names"), "{error}");
}

#[test]
fn a_server_refuses_tokens_that_it_did_not_mint() {
    let (server, foreign) = (Server::start(), Server::start());
    let fingerprint = server.token(JoinRole::Node).fingerprint;
    let forged_roots = Token { fingerprint, ..foreign.token(JoinRole::Node) };
    let forged_role = Token { role: JoinRole::Node, ..server.token(JoinRole::Client) };
    for token in [forged_roots, forged_role] {
        let reason = refusal(join(&[server.addr()], &token, None, PATIENCE));
        assert!(reason.contains("not minted by this server's authority"), "{reason}");
    }
}

/// Returns the join request of a process with a new key.
fn request(token: &str) -> JoinRequest {
    let key = Key::generate().unwrap();
    JoinRequest { token: token.to_owned(), proof: key.prove(token), key: key.public(), resume: None }
}

#[test]
fn who_asks_again_by_the_same_key_is_given_the_same_name_also_by_a_server_that_goes_on() {
    let Server { process, authority, folder } = Server::start();
    let token = authority.issue_token(JoinRole::Participant, HOUR, SystemTime::now()).unwrap().to_string();
    let (asked, other) = (request(&token), request(&token));
    let admit = |authority: &Authority, request: &JoinRequest| {
        authority.admit(request, SystemTime::now()).map(|admission| admission.who)
    };
    let first = admit(&authority, &asked).ok();
    assert!(first.is_some());
    assert_eq!(admit(&authority, &asked).ok(), first, "its answer may be lost with the server that it asked");
    assert!(matches!(admit(&authority, &other), Err(JoinRefusal::Used)), "another's key");
    drop((process, authority));
    let next = Authority::load_or_create(folder.path()).unwrap();
    assert_eq!(admit(&next, &asked).ok(), first);
    assert!(matches!(admit(&next, &other), Err(JoinRefusal::Used)));
    #[cfg(feature = "physics")]
    {
        next.bar(first.unwrap(), "cheating".to_owned());
        assert!(matches!(admit(&next, &asked), Err(JoinRefusal::Used)), "it needs a new token");
    }
}

#[test]
fn a_mistyped_token_is_told_from_a_refused_one() {
    let server = Server::start();
    let request = request("dcd1-aaaaaaaaaaaaaaaa");
    let reason = reply(&server, &request.encode(PROTOCOL_VERSION));
    assert!(reason.contains("mistyped"), "{reason}");
}

#[test]
fn unlike_versions_are_both_named() {
    let server = Server::start();
    let request = request("");
    let reason = reply(&server, &request.encode(77));
    let ours = format!("version {PROTOCOL_VERSION},");
    assert!(reason.contains(&ours) && reason.contains("speaks 77;"), "{reason}");
}

#[test]
fn requests_of_any_bytes_are_refused_and_spend_no_token() {
    let server = Server::start();
    let token = server.token(JoinRole::Node);
    let whole = request(&token.to_string()).encode(PROTOCOL_VERSION);
    // A request with a key that is not the joiner's.
    let other = Key::generate().unwrap();
    let strange = JoinRequest { key: other.public(), ..request(&token.to_string()) }.encode(PROTOCOL_VERSION);
    for request in [&b""[..], b"join", b"GET / HTTP/1.1", &whole[..whole.len() - 1], &strange] {
        assert!(reply(&server, request).contains("cannot be read"));
    }
    join(&[server.addr()], &token, None, PATIENCE).unwrap();
}

#[test]
fn a_resume_key_brings_the_same_ids_back() {
    let server = Server::start();
    let first = server.join(JoinRole::Participant);
    server.join(JoinRole::Participant);
    let resumed =
        join(&[server.addr()], &server.token(JoinRole::Participant), first.resume(), PATIENCE).unwrap();
    assert_eq!(resumed.who(), first.who());
    assert_eq!(resumed.resume(), first.resume());

    let wrong_role =
        refusal(join(&[server.addr()], &server.token(JoinRole::Client), first.resume(), PATIENCE));
    assert!(wrong_role.contains("--role participant"), "{wrong_role}");
    let foreign = Server::start().join(JoinRole::Client);
    let foreign =
        refusal(join(&[server.addr()], &server.token(JoinRole::Client), foreign.resume(), PATIENCE));
    assert!(foreign.contains("not of this server's authority"), "{foreign}");
    assert_eq!(server.join(JoinRole::Node).node(), Some(NodeId(3)), "a resumed id is not given to another");
}

#[test]
fn who_was_sent_away_comes_back_by_a_new_token_alone() {
    let server = Server::start();
    let identity = server.join(JoinRole::Participant);
    let path = server.folder.path().join("identity.pem");
    identity.save(&path).unwrap();
    let again = || Process::start(Identity::load(&path).unwrap(), None, Limits::default());
    again().connect_to(&server.process);
    server.process.closed();
    server.process.net.bar(identity.who(), "it cheats".to_owned());
    let process = again();
    process.net.connect(server.addr(), PeerName::Server);
    let NetEvent::ConnectFailed { error, .. } = process.next() else { panic!("it is let in") };
    let is_told = matches!(&error, NetError::Refused { code: CloseCode::SENT_AWAY, reason, .. } if reason == "it cheats");
    assert!(is_told, "{error:?}");
    let refused = refusal(renew(&[server.addr()], &identity, PATIENCE));
    assert!(refused.contains("new token"), "{refused}");
    let token = server.token(JoinRole::Participant);
    let for_ever = Duration::MAX;
    let back = join(&[server.addr()], &token, identity.resume(), for_ever).unwrap();
    assert_eq!(back.who(), identity.who());
    Process::start(back, None, Limits::default()).connect_to(&server.process);
}

#[test]
fn an_identity_is_saved_for_its_owner_only_and_still_proves_the_name() {
    let server = Server::start();
    let identity = server.join(JoinRole::Participant);
    let path = server.folder.path().join("identity.pem");
    identity.save(&path).unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        for path in [&path, &server.folder.path().join("authority.pem")] {
            assert_eq!(std::fs::metadata(path).unwrap().permissions().mode() & 0o777, 0o600);
        }
    }
    let loaded = Identity::load(&path).unwrap();
    assert_eq!((loaded.who(), loaded.resume()), (identity.who(), identity.resume()));
    assert_eq!(loaded.expires(), identity.expires());
    let life = identity.expires().duration_since(SystemTime::now()).unwrap();
    assert!((23 * HOUR..=24 * HOUR).contains(&life), "{life:?}");
    Process::start(loaded, None, Limits::default()).connect_to(&server.process);
    std::fs::write(&path, "nonsense").unwrap();
    assert!(matches!(Identity::load(&path), Err(NetError::Damaged { .. })));
}

#[test]
fn a_certificate_of_a_server_whose_clock_was_ahead_is_accepted() {
    let server = Server::start();
    let mut node = server.join(JoinRole::Node);
    node.certificate = server.authority.issued(&node, SystemTime::now() + 2 * HOUR);
    Process::start(node, None, Limits::default()).connect_to(&server.process);
}

#[test]
fn an_expired_certificate_proves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let authority = Authority::load_or_create(folder.path()).unwrap();
    let token = authority.issue_token(JoinRole::Node, HOUR, SystemTime::now()).unwrap();
    let authority = Arc::new(authority.with_certificate_life(HOUR));
    let identity = authority.server_identity().unwrap();
    let server = Process::start(identity, Some(authority.clone()), Limits::default());
    let mut node = join(&[server.net.local_addr()], &token, None, PATIENCE).unwrap();
    // The same name and key, but issued the day before yesterday.
    node.certificate = authority.issued(&node, SystemTime::now() - 48 * HOUR);
    let node = Process::start(node, None, Limits::default());
    node.net.connect(server.net.local_addr(), PeerName::Server);
    let error = node.refused();
    assert!(error.to_string().contains("does not accept our certificate"), "{error}");
}

#[test]
fn a_process_whose_certificate_expired_a_month_ago_has_it_renewed_and_is_let_in() {
    let server = Server::start();
    let mut node = server.join(JoinRole::Node);
    // As if the machine had slept for thirty days.
    let then = SystemTime::now() - 30 * 24 * HOUR;
    node.certificate = server.authority.issued(&node, then);
    node.expires_unix_s = unix_seconds(then + 24 * HOUR);
    let config = NetConfig {
        listen: anywhere(),
        identity: node,
        authority: None,
        renewed_by: vec![server.addr()],
        // It also shows the new certificate to callers that have to prove their address first.
        limits: Limits { handshakes_before_retry: 0, ..Limits::default() },
    };
    let (net, events) = Net::start(config).unwrap();
    let deadline = Instant::now() + PATIENCE;
    while net.expires() < SystemTime::now() + 23 * HOUR {
        assert!(Instant::now() < deadline, "its certificate is not renewed");
        std::thread::yield_now();
    }
    // In both directions: as the process that dials, and as the one that is dialled.
    let renewed = Process { net, events };
    renewed.connect_to(&server.process);
    let other = Process::start(server.join(JoinRole::Node), None, Limits::default());
    other.connect_to(&renewed);
}

#[test]
fn a_server_that_is_at_one_of_several_addresses_is_joined_and_dialled_there() {
    // Nobody answers at the first address, and the server comes to the second only later.
    let silent = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let later = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let places = [silent.local_addr().unwrap(), later.local_addr().unwrap()];
    let folder = tempfile::tempdir().unwrap();
    let authority = Arc::new(Authority::load_or_create(folder.path()).unwrap());
    let token = authority.issue_token(JoinRole::Node, PATIENCE, SystemTime::now()).unwrap();
    let joined = std::thread::scope(|scope| {
        let joining = scope.spawn(|| join(&places, &token, None, PATIENCE));
        let mut first = [0; 2_048];
        // Both are dialled before either answers.
        silent.recv_from(&mut first).unwrap();
        later.recv_from(&mut first).unwrap();
        drop(later);
        let config = NetConfig {
            listen: places[1],
            identity: authority.server_identity().unwrap(),
            authority: Some(authority.clone()),
            renewed_by: Vec::new(),
            limits: Limits::default(),
        };
        let started = Net::start(config).unwrap();
        (joining.join().unwrap().unwrap(), started)
    });
    let (identity, (_server, _events)) = joined;
    let listen = "127.0.0.1:0".parse().unwrap();
    let config =
        NetConfig { listen, identity, authority: None, renewed_by: Vec::new(), limits: Limits::default() };
    let (node, events) = Net::start(config).unwrap();
    node.connect_to_one_of(&places, PeerName::Server);
    let connected = events.recv_timeout(PATIENCE).unwrap();
    assert!(matches!(connected, NetEvent::Connected { addr, .. } if addr == places[1]), "{connected:?}");
}

#[test]
fn a_certificate_is_renewed_by_its_own_key_and_authority_alone() {
    let server = Server::start();
    let (node, other) = (server.join(JoinRole::Node), server.join(JoinRole::Node));
    let [key, other_key] = [&node, &other].map(|identity| Key::from_der(&identity.key).unwrap());
    let request = |certificate: &CertificateDer<'static>, key: &Key| RenewalRequest {
        certificate: certificate.clone(),
        key: key.public(),
        proof: key.prove_renewal(),
    };
    let now = SystemTime::now();
    let renewed = server.authority.renew(&request(&node.certificate, &key), now).unwrap();
    assert_eq!(renewed.who, node.who());
    assert_eq!(renewed.resume, node.resume().unwrap().to_string());
    let is_refused = |request| {
        let refusal = server.authority.renew(&request, now).err().map(|refusal| refusal.to_string());
        refusal.is_some_and(|text| text.contains("join anew with a fresh token"))
    };
    assert!(is_refused(request(&node.certificate, &other_key)), "the key of another process");
    let mut forged = request(&node.certificate, &other_key);
    forged.key = key.public();
    assert!(is_refused(forged), "another process signs");
    let folder = tempfile::tempdir().unwrap();
    let foreign = Authority::load_or_create(folder.path()).unwrap();
    assert!(is_refused(request(&foreign.issued(&node, now), &key)), "another authority");
    let own = server.authority.server_identity().unwrap();
    assert!(is_refused(request(&own.certificate, &Key::from_der(&own.key).unwrap())), "the server itself");
    assert!(is_refused(request(&CertificateDer::from(vec![0x30; 9]), &key)), "no certificate");
}
