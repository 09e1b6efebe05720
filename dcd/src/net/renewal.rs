//! Renews certificates: a process asks its server for a new one long before its own expires, and new links
//! use it from then on.
//!
//! The holder of the key of a certificate of this authority gets a new certificate for the same name, even if
//! the old one has expired: a machine that slept, or whose clock was set, is still the same process. It asks
//! at once when a peer finds its certificate expired, as a server does that was started again with its clock
//! days ahead.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime};

use rustls::pki_types::CertificateDer;

use super::calls::Shared;
use super::join::{decode_reply, exchange, exchange_here};
use super::quic_config::{client_config, server_config};
use super::renewal_request::RenewalRequest;
use super::verify::fingerprint;
use super::{Identity, NetError};

/// The time between two looks at the wall clock, which jumps when it is set or when the machine has slept.
/// Until the jump is seen, others refuse new links with this process.
const LOOK: Duration = Duration::from_secs(1);
/// The pause after which a server that gave no certificate is asked again.
const RETRY: Duration = Duration::from_secs(10);
/// The longest time that the server may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// The share of a certificate's life after which it is renewed.
const RENEW_AFTER: f64 = 2.0 / 3.0;
/// The most elapsed time after which a certificate is renewed, whatever the clock says: by a clock that is
/// behind, it seems to last for long.
const MOST: Duration = Duration::from_secs(16 * 3_600);
/// The least elapsed time between two renewals, for a process by whose clock, or a peer's, each new
/// certificate has already expired.
const LEAST: Duration = Duration::from_secs(300);

/// Renews the identity of a process at its server, for as long as the process runs.
pub(super) async fn renew_in_time(shared: Arc<Shared>, mut identity: Identity, servers: Vec<SocketAddr>) {
    let left = |identity: &Identity, now| identity.expires().duration_since(now).unwrap_or_default();
    let (mut begun, mut counted) = (SystemTime::now(), Instant::now());
    // The first renewal of a certificate that seems to have expired is made at once.
    let mut least = Duration::ZERO;
    let (mut is_expiry_told, mut is_refusal_told) = (false, false);
    // The first renewal because of a refusal is made at once, too.
    let mut refused_at: Option<Instant> = None;
    loop {
        let (mut pause, now) = (LOOK, SystemTime::now());
        let is_refused = shared.is_refused_for_age.load(Ordering::Relaxed)
            && refused_at.is_none_or(|renewed| renewed.elapsed() >= LEAST);
        if is_refused || is_due(identity.expires(), begun, now, counted.elapsed(), least) {
            if is_refused && identity.expires() > now && !std::mem::replace(&mut is_refusal_told, true) {
                tracing::warn!(
                    who = %identity.who,
                    "a peer finds this certificate expired, which is valid by this machine's clock: the clocks differ by \
                     hours; set both (NTP). A new certificate is asked for"
                );
            }
            match renewed(&shared, &identity, &servers).await {
                Ok(fresh) => {
                    identity = fresh;
                    (begun, counted, least) = (SystemTime::now(), Instant::now(), LEAST);
                    (is_expiry_told, is_refusal_told) = (false, false);
                    if is_refused {
                        refused_at = Some(Instant::now());
                    }
                    shared.is_refused_for_age.store(false, Ordering::Relaxed);
                    let left = left(&identity, SystemTime::now());
                    if left.is_zero() {
                        tracing::warn!(
                            who = %identity.who,
                            "the new certificate has expired by this machine's clock, which is a day or more ahead of \
                             the server's: no link can be made with others; set both clocks (NTP)"
                        );
                    } else {
                        let hours = left.as_secs() / 3600;
                        tracing::info!(who = %identity.who, hours, "the certificate is renewed");
                    }
                }
                Err(error) => {
                    pause = RETRY;
                    if identity.expires() <= SystemTime::now() && !is_expiry_told {
                        is_expiry_told = true;
                        tracing::warn!(
                            who = %identity.who, %error,
                            "the certificate has expired, and others refuse new links with this process; the server is \
                             asked for a new one again and again"
                        );
                    } else {
                        tracing::info!(who = %identity.who, %error, "the certificate is not renewed yet");
                    }
                }
            }
        }
        tokio::time::sleep(pause).await;
    }
}

/// Returns whether a certificate is due that the process has had since `begun` by the clock, and for `passed`
/// of elapsed time. The clock counts the time in which a machine sleeps, elapsed time does not. `least` is
/// the least elapsed time, for a certificate that has expired by the clock.
fn is_due(
    expires: SystemTime,
    begun: SystemTime,
    now: SystemTime,
    passed: Duration,
    least: Duration,
) -> bool {
    let left = expires.duration_since(begun).unwrap_or_default();
    let is_late = now >= expires - left.mul_f64(1.0 - RENEW_AFTER);
    (is_late && !left.is_zero()) || passed >= left.mul_f64(RENEW_AFTER).clamp(least, MOST)
}

/// Requests a new certificate and returns the identity with it, for a process that starts again under its
/// former name. It needs no token.
///
/// # Panics
/// Inside a tokio runtime: this call blocks.
pub fn renew(servers: &[SocketAddr], identity: &Identity, timeout: Duration) -> Result<Identity, NetError> {
    let request = RenewalRequest::of(identity)?.encode();
    let (server, reply) = exchange(servers, fingerprint(&identity.authority), &request, timeout)?;
    fresh(identity, server, &reply)
}

/// Requests a new certificate and returns the identity with it. New links use it from here on.
async fn renewed(shared: &Shared, identity: &Identity, servers: &[SocketAddr]) -> Result<Identity, NetError> {
    let request = RenewalRequest::of(identity)?.encode();
    let (server, reply) =
        exchange_here(servers, fingerprint(&identity.authority), &request, PATIENCE).await?;
    let fresh = fresh(identity, server, &reply)?;
    let answer = server_config(&fresh, false, &shared.limits)?;
    shared.set_dial(client_config(&fresh, &shared.limits)?);
    shared.set_answer(answer);
    shared.set_expiry(fresh.expires());
    Ok(fresh)
}

/// Returns the identity with the certificate in the server's answer.
fn fresh(identity: &Identity, server: SocketAddr, reply: &[u8]) -> Result<Identity, NetError> {
    let broken = |detail: &str| NetError::Broken { addr: server, detail: detail.to_owned() };
    let admission = match decode_reply(reply).ok_or_else(|| broken("its answer cannot be read"))? {
        Ok(admission) => admission,
        Err(refused) => return Err(refused.by(server)),
    };
    if admission.who != identity.who {
        return Err(broken("its answer names another process"));
    }
    Ok(Identity {
        who: identity.who,
        key: identity.key.clone_key(),
        certificate: CertificateDer::from(admission.certificate),
        authority: identity.authority.clone(),
        expires_unix_s: admission.expires_unix_s,
        resume: identity.resume.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_certificate_is_due_before_it_expires_however_wrong_the_clock_is() {
        const HOUR: Duration = Duration::from_secs(3_600);
        const SECOND: Duration = Duration::from_secs(1);
        let begins = SystemTime::UNIX_EPOCH + 100_000 * HOUR;
        let expires = begins + 24 * HOUR;
        let after = |begun: SystemTime, passed| is_due(expires, begun, begun + passed, passed, LEAST);
        assert!(!after(begins, 16 * HOUR - SECOND) && after(begins, 16 * HOUR));
        let behind = begins - 9_000 * HOUR;
        assert!(!after(behind, 16 * HOUR - SECOND) && after(behind, 16 * HOUR));
        let ahead = begins + 9_000 * HOUR;
        assert!(!after(ahead, LEAST - SECOND) && after(ahead, LEAST));
        assert!(is_due(expires, ahead, ahead, Duration::ZERO, Duration::ZERO), "at the start");
        assert!(is_due(expires, begins, begins + 16 * HOUR, SECOND, LEAST), "the machine slept");
        assert!(is_due(expires, behind, begins + 23 * HOUR, SECOND, LEAST), "the clock is set right");
        // A renewal does not wait until a short life is over.
        assert!(is_due(begins + 30 * SECOND, begins, begins + 20 * SECOND, 20 * SECOND, LEAST));
    }
}
