//! Implements the server's certificate authority: mints tokens and redeems them for certificates.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer,
    KeyUsagePurpose, PublicKeyData,
};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivatePkcs8KeyDer};

use super::files::{at, open_private, replace_private};
use super::identity::pem_section;
use super::join::{Admission, JoinRequest};
use super::journal::{FileJournal, Journal};
use super::key::Key;
use super::ledger::Ledger;
use super::renewal_request::RenewalRequest;
use super::token::{NONCE_BYTES, Secret, reset_key, unix_seconds};
use super::verify::{fingerprint, is_signed_by, owner_of, random};
use super::{Identity, JoinRefusal, JoinRole, NetError, PeerName, ResumeKey, Token};
#[cfg(feature = "physics")]
use crate::space::{ClientId, NodeId};

/// The root of trust of one world, kept in the server's data folder. The holder of its key decides who takes
/// part.
///
/// Any process that may read the folder can mint tokens while the server runs; only the server redeems them.
pub struct Authority {
    folder: PathBuf,
    issuer: Issuer<'static, Key>,
    certificate: CertificateDer<'static>,
    fingerprint: [u8; 32],
    secret: Secret,
    certificate_life: Duration,
    /// The journal of joins, if they are not recorded in the folder. Opening the ledger takes it.
    journal: Mutex<Option<Box<dyn Journal>>>,
    ledger: Mutex<Option<Ledger>>,
    /// The names that are let in with a new token only, with the reason.
    barred: Mutex<BTreeMap<PeerName, String>>,
    /// Says whether this server has ended, so that another one may open the ledger.
    is_over: AtomicBool,
}

/// The lifetime of certificates of nodes and clients, unless [`Authority::with_certificate_life`] sets
/// another.
const CERTIFICATE_LIFE: Duration = Duration::from_secs(24 * 3600);
/// The time that a certificate is accepted beyond its life, since clocks differ.
const CLOCK_SKEW: Duration = Duration::from_secs(600);
/// The lifetime of the server's own certificate, which is made anew at each start. A thief of its key has the
/// folder, and so the authority's key. A short life would only stop servers that run long, or that started
/// while their clock was decades behind.
const SERVER_CERTIFICATE_LIFE: Duration = Duration::from_secs(200 * 365 * 24 * 3600);

impl Authority {
    /// Loads the authority of the folder, or makes it on first use.
    pub fn load_or_create(folder: &Path) -> Result<Self, NetError> {
        Self::load_or_adopt(folder, |own| Ok::<_, NetError>(own.to_owned()))
    }

    /// Loads the authority that several servers share. `agree` gets the authority of this folder, or a new
    /// one, and returns the one that all share: the first that any server passed.
    pub(crate) fn load_or_adopt<E: From<NetError>>(
        folder: &Path,
        agree: impl FnOnce(&str) -> Result<String, E>,
    ) -> Result<Self, E> {
        std::fs::create_dir_all(folder).map_err(at(folder))?;
        // A server and `dcd token` may both be first to make it.
        let lock_path = folder.join("authority.lock");
        let lock = open_private(&lock_path, OpenOptions::new().create(true).append(true))?;
        lock.lock().map_err(at(&lock_path))?;
        let path = folder.join("authority.pem");
        let is_there = path.try_exists().map_err(at(&path))?;
        let own =
            if is_there { std::fs::read_to_string(&path).map_err(at(&path))? } else { new_authority()? };
        let shared = agree(&own)?;
        match (is_there, shared == own) {
            (true, true) => {}
            (true, false) => return Err(NetError::OtherAuthority { path }.into()),
            (false, _) => replace_private(&path, shared.as_bytes())?,
        }
        Ok(Self::load(folder, &path)?)
    }

    fn load(folder: &Path, path: &Path) -> Result<Self, NetError> {
        let remedy = "restore it from a backup: without it no token and no identity of its world counts any more; if there is none, move it \
                      away, and let all nodes and clients join anew";
        let damaged = |what: &str| NetError::Damaged { path: path.to_owned(), what: what.to_owned(), remedy };
        let pem = std::fs::read(path).map_err(at(path))?;
        let key_der = PrivatePkcs8KeyDer::from_pem_slice(&pem).map_err(|_| damaged("no private key"))?;
        let key = Key::from_der(&key_der).ok_or_else(|| damaged("a private key that is not Ed25519"))?;
        let certificate = CertificateDer::from_pem_slice(&pem).map_err(|_| damaged("no certificate"))?;
        // Derived, not a file of its own: the holder of the key may issue certificates anyway, and one file
        // cannot contradict itself.
        let secret =
            blake3::derive_key("dcd 2026 seal of join tokens and resume keys", key_der.secret_pkcs8_der());
        Ok(Self {
            folder: folder.to_owned(),
            issuer: Issuer::new(of_authority(), key),
            fingerprint: fingerprint(&certificate),
            certificate,
            secret: Secret(secret),
            certificate_life: CERTIFICATE_LIFE,
            journal: Mutex::new(None),
            ledger: Mutex::new(None),
            barred: Mutex::default(),
            is_over: AtomicBool::new(false),
        })
    }

    /// Sets the lifetime of certificates, instead of a day.
    pub fn with_certificate_life(mut self, life: Duration) -> Self {
        self.certificate_life = life;
        self
    }

    /// Mints a token that lets one process join as `role` until `now + valid_for`.
    pub fn issue_token(
        &self,
        role: JoinRole,
        valid_for: Duration,
        now: SystemTime,
    ) -> Result<Token, NetError> {
        self.issue_token_for(1, role, valid_for, now)
    }

    /// Mints a token that lets `uses` processes join.
    pub fn issue_token_for(
        &self,
        uses: u32,
        role: JoinRole,
        valid_for: Duration,
        now: SystemTime,
    ) -> Result<Token, NetError> {
        if role == JoinRole::Server {
            return Err(NetError::ServerToken);
        }
        let nonce: [u8; NONCE_BYTES] = random()?;
        Ok(Token::mint(
            &self.secret,
            role,
            nonce,
            unix_seconds(now).saturating_add(valid_for.as_secs()),
            uses,
            self.fingerprint,
        ))
    }

    /// Makes the server's own identity, anew at each start.
    pub fn server_identity(&self) -> Result<Identity, NetError> {
        let now = SystemTime::now();
        let key = Key::generate()?;
        let certificate = self.issue(PeerName::Server, &key, now, SERVER_CERTIFICATE_LIFE).map_err(tls)?;
        Ok(Identity {
            who: PeerName::Server,
            key: key.der().clone_key(),
            certificate,
            authority: self.certificate.clone(),
            expires_unix_s: unix_seconds(now + SERVER_CERTIFICATE_LIFE),
            resume: None,
        })
    }

    /// Returns the key by which this server recognises links of its predecessor and proves to their peers
    /// that those links are over.
    pub(super) fn reset_key(&self) -> [u8; 64] {
        reset_key(&self.secret.0)
    }

    /// Records joins in `journal`, and not in the folder.
    #[cfg(feature = "etcd")]
    pub(crate) fn record_in(&self, journal: Box<dyn Journal>) {
        *self.journal.lock().unwrap_or_else(PoisonError::into_inner) = Some(journal);
    }

    /// Opens the ledger, which one server at a time may have open; fails if another one has it.
    pub(crate) fn open_ledger(&self) -> Result<(), NetError> {
        self.ledger(SystemTime::now()).map(|_| ())
    }

    /// Closes the ledger for good, since this server has ended, so that another one may open it.
    #[cfg(feature = "physics")]
    pub(crate) fn close_ledger(&self) {
        let mut ledger = self.ledger.lock().unwrap_or_else(PoisonError::into_inner);
        self.is_over.store(true, Ordering::Relaxed);
        *ledger = None;
    }

    /// Gives no name up to these any more. Returns whether the record of joins did not know all of them.
    #[cfg(feature = "physics")]
    pub(crate) fn keep_names(&self, node: NodeId, client: ClientId) -> Result<bool, NetError> {
        let mut ledger = self.ledger(SystemTime::now())?;
        ledger.as_mut().expect("ledger() opens it").keep_names(node, client)
    }

    /// Returns whether a node has ever been given this name.
    #[cfg(feature = "physics")]
    pub(crate) fn has_named(&self, node: NodeId) -> bool {
        let ledger = self.ledger(SystemTime::now());
        ledger.is_ok_and(|ledger| ledger.as_ref().is_some_and(|ledger| ledger.has_named(node)))
    }

    /// Writes the authority and its record of joins to another folder, for a server that goes on with a copy
    /// of the world.
    #[cfg(feature = "physics")]
    pub(crate) fn copy_to(&self, folder: &Path) -> Result<(), NetError> {
        let own = self.folder.join("authority.pem");
        let pem = std::fs::read(&own).map_err(at(&own))?;
        replace_private(&folder.join("authority.pem"), &pem)?;
        let ledger = self.ledger(SystemTime::now())?;
        let joins = ledger.as_ref().expect("ledger() opens it").copy();
        replace_private(&folder.join("joins.log"), joins.as_bytes())
    }

    /// Bars a process: it is let in with a new token only, for as long as this server runs.
    #[cfg(feature = "physics")]
    pub(super) fn bar(&self, who: PeerName, reason: String) {
        self.barred().insert(who, reason);
    }

    /// Returns why a process is let in with a new token only, if it is barred.
    pub(super) fn barred_for(&self, who: PeerName) -> Option<String> {
        self.barred().get(&who).cloned()
    }

    fn barred(&self) -> MutexGuard<'_, BTreeMap<PeerName, String>> {
        self.barred.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Redeems a token. When this returns `Ok`, one use of it is spent, durably.
    pub(super) fn admit(&self, request: &JoinRequest, now: SystemTime) -> Result<Admission, JoinRefusal> {
        let token: Token = request.token.parse().map_err(JoinRefusal::BadToken)?;
        if !token.is_sealed_by(&self.secret) {
            return Err(JoinRefusal::OtherAuthority);
        }
        let now_s = unix_seconds(now);
        if token.expires_unix_s < now_s {
            return Err(JoinRefusal::Expired);
        }
        let resumed = request.resume.as_deref().map(|key| self.resumed(key, token.role)).transpose()?;
        // The key must be good before the token is spent.
        if !request.key.is_proved(&request.token, &request.proof) {
            return Err(JoinRefusal::Malformed("the proof that its key is its own"));
        }
        let failed = |error: &dyn std::fmt::Display| JoinRefusal::Server(error.to_string());

        let mut ledger = self.ledger(now).map_err(|error| failed(&error))?;
        let ledger = ledger.as_mut().expect("ledger() opens it");
        let key = request.key.mark();
        // A joiner that asks again with the same key never got its answer: the server that it asked may have
        // died in between.
        let again = ledger.given(&token.nonce, key, token.role);
        let who = match again.filter(|who| self.barred_for(*who).is_none()) {
            Some(who) => who,
            None if ledger.uses(&token.nonce) >= token.uses => return Err(JoinRefusal::Used),
            None => ledger
                .record(token.nonce, token.expires_unix_s, token.role, resumed, key, now_s)
                .map_err(|error| failed(&error))?,
        };
        // Only the key is taken from the request. The authority gives the names.
        let certificate =
            self.issue(who, &request.key, now, self.certificate_life).map_err(|error| failed(&error))?;
        self.barred().remove(&who);
        Ok(self.admission(who, &certificate, now))
    }

    /// Issues a new certificate for the name in an old one, whose key has signed the request. The old one may
    /// have expired.
    pub(super) fn renew(&self, request: &RenewalRequest, now: SystemTime) -> Result<Admission, JoinRefusal> {
        let who =
            owner_of(&request.certificate, &self.certificate, now).ok_or(JoinRefusal::BadCertificate)?;
        if who == PeerName::Server
            || !is_signed_by(&request.certificate, &request.key.renewal(), &request.proof)
        {
            return Err(JoinRefusal::BadCertificate);
        }
        if self.barred_for(who).is_some() {
            return Err(JoinRefusal::SentAway);
        }
        let certificate = self
            .issue(who, &request.key, now, self.certificate_life)
            .map_err(|error| JoinRefusal::Server(error.to_string()))?;
        Ok(self.admission(who, &certificate, now))
    }

    fn admission(&self, who: PeerName, certificate: &CertificateDer<'_>, now: SystemTime) -> Admission {
        Admission {
            who,
            certificate: certificate.to_vec(),
            authority: self.certificate.to_vec(),
            expires_unix_s: unix_seconds(now + self.certificate_life),
            resume: ResumeKey::mint(&self.secret, who).to_string(),
        }
    }

    /// Returns a certificate with the names and key of another one, as if issued `then`.
    #[cfg(test)]
    pub(super) fn issued(&self, identity: &Identity, then: SystemTime) -> CertificateDer<'static> {
        let key = Key::from_der(&identity.key).unwrap();
        self.issue(identity.who, &key, then, self.certificate_life).unwrap()
    }

    fn resumed(&self, key: &str, role: JoinRole) -> Result<PeerName, JoinRefusal> {
        let key: ResumeKey = key.parse().map_err(|_| JoinRefusal::BadResumeKey)?;
        if !key.is_sealed_by(&self.secret) {
            return Err(JoinRefusal::BadResumeKey);
        }
        if key.who.role() != role {
            return Err(JoinRefusal::WrongRole { token: role, resume: key.who.role() });
        }
        Ok(key.who)
    }

    fn ledger(&self, now: SystemTime) -> Result<MutexGuard<'_, Option<Ledger>>, NetError> {
        let mut ledger = self.ledger.lock().unwrap_or_else(PoisonError::into_inner);
        if ledger.is_none() {
            // Checked under the lock of the ledger, so that the answer to a late join does not open it again.
            if self.is_over.load(Ordering::Relaxed) {
                return Err(NetError::Joins("the server has ended; ask the one that goes on".to_owned()));
            }
            let shared = self.journal.lock().unwrap_or_else(PoisonError::into_inner).take();
            let journal = match shared {
                Some(journal) => journal,
                None => Box::new(FileJournal::open(&self.folder)?),
            };
            *ledger = Some(Ledger::open(journal, unix_seconds(now))?);
        }
        Ok(ledger)
    }

    fn issue(
        &self,
        who: PeerName,
        key: &impl PublicKeyData,
        now: SystemTime,
        life: Duration,
    ) -> Result<CertificateDer<'static>, rcgen::Error> {
        let mut params = CertificateParams::new(who.dns_names())?;
        params.distinguished_name = named(&who.to_string());
        let epoch = rcgen::date_time_ymd(1970, 1, 1);
        let now = now.duration_since(UNIX_EPOCH).unwrap_or_default();
        // Valid since 1970, so that peers whose clocks are behind, or are set back later, accept it too.
        // Nobody can use it before it exists.
        params.not_before = epoch;
        params.not_after = epoch + now + life + CLOCK_SKEW;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        // Every process dials and is dialled.
        params.extended_key_usages =
            vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
        Ok(params.signed_by(key, &self.issuer)?.der().clone())
    }
}

/// Returns the text of a new `authority.pem`: key and self-signed certificate.
fn new_authority() -> Result<String, NetError> {
    let key = Key::generate()?;
    let certificate = of_authority().self_signed(&key).map_err(tls)?;
    let key = pem_section("PRIVATE KEY", key.der().secret_pkcs8_der());
    Ok(key + &pem_section("CERTIFICATE", certificate.der()))
}

/// Returns the parameters of the authority's own certificate.
fn of_authority() -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = named("dcd authority");
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::DigitalSignature];
    params
}

fn named(name: &str) -> DistinguishedName {
    let mut distinguished_name = DistinguishedName::new();
    distinguished_name.push(DnType::CommonName, name);
    distinguished_name
}

fn tls(error: rcgen::Error) -> NetError {
    NetError::Tls(error.to_string())
}
