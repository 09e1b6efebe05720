//! Tests the directory in an etcd that answers over TLS, and in one that has users.

use std::collections::BTreeSet;
use std::path::Path;

use super::cluster::{Authority, Certified};
use super::*;

/// Returns the error that the world at this place cannot be opened with.
fn why(place: &str) -> String {
    let world = EtcdWorld::at(EtcdAddress::parse(place).unwrap());
    world.and_then(|mut world| world.authority("key")).unwrap_err().to_string()
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn it_does_over_tls_what_a_directory_does() {
    let Some(etcd) = EtcdCluster::start_over_tls(&[Certified::Well], &[]) else { return };
    let count = AtomicUsize::new(0);
    let new = || {
        let name = format!("world-{}", count.fetch_add(1, Ordering::Relaxed));
        open(&etcd.place(&name), "one")
    };
    let reopen = |directory: EtcdDirectory| {
        let place = place_of(&directory) + etcd.options();
        drop(directory);
        open(&place, "one")
    };
    conformance::all(&new, &reopen);
    let mut directory = new();
    directory.commit(&large(1), &[]).unwrap();
    let before = directory.load().unwrap();
    assert_eq!(reopen(directory).load().unwrap(), before);
}

#[test]
fn what_is_at_fault_with_tls_is_said_and_members_that_are_well_are_asked() {
    let members = [Certified::Elsewhere, Certified::Expired, Certified::Well];
    let Some(etcd) = EtcdCluster::start_over_tls(&members, &[]) else { return };
    let (folder, own) = (etcd.folder(), etcd.options());
    let other = Authority::new(folder, "other").options(Certified::Well);
    let only = |member: usize, options: &str| format!("etcds://{}/faults{options}", etcd.member(member));
    let (cacert, _) = own.split_once('&').unwrap();
    let (other_cacert, other_pair) = other.split_once('&').unwrap();
    for (place, remedy) in [
        (only(0, own), "lacks the host"),
        (only(0, own), "elsewhere.example"),
        (only(1, own), "has expired"),
        (only(2, other_cacert), "is not of the authority in cacert"),
        (only(2, cacert), "cert and key"),
        (only(2, &format!("{cacert}&{other_pair}")), "cert and key"),
        (format!("etcd://{}/faults", etcd.member(2)), "write etcds://"),
        (format!("etcds://{}/faults{own}", etcd.open_member(2)), "write etcd://"),
    ] {
        let why = why(&place);
        println!("{why}");
        assert!(why.contains(remedy), "{why}");
        assert!(why.contains("cannot use etcd") && why.contains("/faults: "), "{why}");
    }
    let place = etcd.place("faults");
    let mut directory = open(&place, "one");
    directory.commit(&body(1, 1, true), &[]).unwrap();
    directory.renew().unwrap();
    drop(directory);
    assert_eq!(values(&mut open(&place, "two")), [(1, 1)]);
}

#[test]
fn files_that_cannot_be_used_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let options = Authority::new(folder, "own").options(Certified::Well);
    let other = Authority::new(folder, "other").options(Certified::Well);
    let (own_cert, own_key) = options.rsplit_once("&key=").unwrap();
    let (_, other_key) = other.rsplit_once("&key=").unwrap();
    let missing = folder.join("missing").display().to_string();
    let empty = write(folder, "empty", "");
    let locked = write(
        folder,
        "locked",
        "-----BEGIN ENCRYPTED PRIVATE KEY-----\nAAAA\n-----END ENCRYPTED PRIVATE KEY-----\n",
    );
    for (options, file, cause) in [
        (format!("?cacert={missing}"), &missing, "No such file"),
        (format!("?cacert={own_key}"), &own_key.to_owned(), "no certificate in PEM"),
        (format!("{own_cert}&key={locked}"), &locked, "passphrase"),
        (
            format!("{own_cert}&key={other_key}"),
            &other_key.to_owned(),
            "not the private key of the certificate",
        ),
        (format!("{options}&user=dcd&password-file={missing}"), &missing, "No such file"),
        (format!("{options}&user=dcd&password-file={empty}"), &empty, "it is empty"),
        (format!("{options}&user=dcd"), &"DCD_ETCD_PASSWORD".to_owned(), "password-file=FILE"),
    ] {
        let why = why(&format!("etcds://127.0.0.1:1/files{options}"));
        assert!(why.contains(file) && why.contains(cause), "{why}");
        assert!(why.contains("of etcds://127.0.0.1:1/files)"), "{why}");
    }
}

#[test]
fn a_user_with_its_password_and_a_role_is_let_in_and_nobody_else() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    etcd.add_user("dcd", "of dcd", "dcd/users/");
    etcd.add_user("other", "of other", "dcd/others/");
    let folder = etcd.folder();
    let own = write(folder, "own", "of dcd\n");
    let place = etcd.place("users");
    let as_user = |user: &str, file: &str| format!("{place}?user={user}&password-file={file}");
    // An etcd without users lets a client with a user in. The client goes on when users are enabled.
    let mut directory = open(&as_user("dcd", &own), "one");
    directory.commit(&body(1, 1, true), &[]).unwrap();
    assert_eq!(directory.hold.keys().gateway.token(), None);
    etcd.enable_users();
    directory.commit(&body(1, 2, true), &[]).unwrap();
    directory.renew().unwrap();
    let wrong = write(folder, "wrong", "of dcd?");
    let others = write(folder, "others", "of other\r\n");
    for (place, remedy) in [
        (place.clone(), "user=NAME&password-file=FILE"),
        (as_user("dcd", &wrong), "wrong"),
        (as_user("nobody", &own), "user nobody"),
        (as_user("other", &others), "grant-permission"),
    ] {
        let why = why(&place);
        println!("{why}");
        assert!(why.contains(remedy), "{why}");
    }
    // The former token is refused from then on.
    write(folder, "own", "changed");
    etcd.change_password("dcd", "changed");
    directory.commit(&body(1, 3, true), &[]).unwrap();
    directory.renew().unwrap();
    drop(directory);
    assert_eq!(values(&mut open(&as_user("dcd", &own), "two")), [(1, 3)]);
}

#[test]
fn a_password_that_is_changed_in_etcd_first_ends_nobody() {
    let Some(etcd) = EtcdCluster::start(1) else { return };
    etcd.add_user("dcd", "of dcd", "dcd/changed/");
    etcd.enable_users();
    let password = write(etcd.folder(), "password", "of dcd");
    let place = format!("{}?user=dcd&password-file={password}", etcd.place("changed"));
    let mut keys = Keys::new(EtcdAddress::parse(&place).unwrap()).unwrap();
    keys.read("head").unwrap();
    etcd.change_password("dcd", "another");
    let asked = keys.gateway.read(b"dcd/changed/head");
    assert!(matches!(&asked, Err(gateway::GatewayError::Away(why)) if why.contains(&password)), "{asked:?}");
    write(etcd.folder(), "password", "another");
    keys.gateway.read(b"dcd/changed/head").unwrap();
}

#[test]
fn where_there_are_users_a_certificate_has_no_common_name() {
    let Some(etcd) = EtcdCluster::start_over_tls(&[Certified::Named], &[]) else { return };
    etcd.add_user("dcd", "of dcd", "dcd/named/");
    etcd.enable_users();
    let password = write(etcd.folder(), "password", "of dcd");
    let user = format!("&user=dcd&password-file={password}");
    let place = etcd.place("named") + &user;
    drop(open(&place, "one"));
    let (cert, key) = etcd.issue("named", Certified::Named);
    let (cacert, _) = etcd.options().split_once('&').unwrap();
    let options = format!("{cacert}&cert={}&key={}{user}", cert.display(), key.display());
    let why = why(&format!("etcds://{}/named{options}", etcd.member(0)));
    assert!(why.contains("without for cert"), "{why}");
}

#[test]
fn a_world_is_held_and_its_former_holder_fenced_out_while_tokens_run_out() {
    let folder = tempfile::tempdir().unwrap();
    let key = write(folder.path(), "jwt", &"key".repeat(20));
    let tokens = format!("jwt,priv-key={key},sign-method=HS256,ttl=1s");
    let options = ["--auth-token", &tokens];
    let Some(etcd) = EtcdCluster::start_over_tls(&[Certified::Well], &options) else { return };
    etcd.add_user("dcd", "of dcd", "dcd/tokens/");
    etcd.enable_users();
    let password = write(folder.path(), "password", "of dcd");
    let place = format!("{}&user=dcd&password-file={password}", etcd.place("tokens"));
    let mut former = open(&place, "one");
    let (mut seen, mut value) = (BTreeSet::new(), 0);
    let waits = world(&place).open("two", false, &mut |wait| {
        assert!(matches!(wait, Wait::Held(holder) if holder == "one"), "its holder lives");
        value += 1;
        former.commit(&body(1, value, true), &[]).unwrap();
        former.renew().unwrap();
        seen.extend(former.hold.keys().gateway.token());
        seen.len() < 4 && value < u8::MAX
    });
    assert!(waits.unwrap().is_none());
    assert_eq!(seen.len(), 4, "a token lasts for a second, and this took more");
    former.lease.abandon();
    let mut next = open(&place, "two");
    assert_eq!(values(&mut next), [(1, value)]);
    // By then the former holder's token is refused, too.
    let last = former.hold.keys().gateway.token();
    while former.hold.keys().gateway.token() == last {
        former.hold.keys().read("head").unwrap();
    }
    let place = place_of(&former);
    assert_eq!(former.commit(&body(1, 0, true), &[]), Err(DirectoryError::Deposed { place }));
    assert_eq!(values(&mut next), [(1, value)]);
}

#[test]
fn who_did_not_ask_for_long_logs_in_again() {
    let Some(etcd) = EtcdCluster::start_over_tls(&[Certified::Well], &["--auth-token-ttl", "1"]) else {
        return;
    };
    etcd.add_user("dcd", "of dcd", "dcd/idle/");
    etcd.enable_users();
    let password = write(etcd.folder(), "password", "of dcd");
    let place = format!("{}&user=dcd&password-file={password}", etcd.place("idle"));
    let mut keys = Keys::new(EtcdAddress::parse(&place).unwrap()).unwrap();
    keys.read("head").unwrap();
    let (first, start) = (keys.gateway.token(), Instant::now());
    assert!(first.is_some());
    while keys.gateway.token() == first {
        assert!(start.elapsed() < Duration::from_secs(30), "a token that nobody uses lasts for a second");
        // Each request uses the token, so none may be made for a while.
        std::thread::sleep(Duration::from_millis(2_500));
        keys.read("head").unwrap();
    }
}
