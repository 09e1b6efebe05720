//! Logs in to an etcd that has users: exchanges a password for a token, and does so again whenever etcd
//! refuses the token.
//!
//! Tokens expire. Those of etcd's own kind do so when they were not used for five minutes, or when the member
//! that is asked was restarted; others (JWT) at a set time, or when anything about users was changed. A
//! client whose token is refused logs in and asks again.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde_json::json;
use tracing::warn;

use super::address::User;

/// The environment variable with the password, for users without a password file.
const ENVIRONMENT: &str = "DCD_ETCD_PASSWORD";

/// A user of etcd, and the user's present token.
pub(super) struct Login {
    user: User,
    token: Mutex<Option<String>>,
    /// Says whether etcd does not take the password any more.
    is_refused: AtomicBool,
}

impl Login {
    pub(super) fn new(user: User) -> Self {
        Self { user, token: Mutex::default(), is_refused: AtomicBool::new(false) }
    }

    /// Returns the last token.
    pub(super) fn token(&self) -> Option<String> {
        self.lock().clone()
    }

    pub(super) fn set_token(&self, token: String) {
        *self.lock() = Some(token);
        self.is_refused.store(false, Ordering::Relaxed);
    }

    /// Records that etcd refuses the password, for this reason. Returns whether etcd took a password before:
    /// then the password was changed in etcd and must be changed here, which is logged once.
    pub(super) fn is_refused(&self, cause: &str) -> bool {
        let is_changed = self.lock().is_some();
        if is_changed && !self.is_refused.swap(true, Ordering::Relaxed) {
            let (user, place) = (&self.user.name, self.place());
            warn!(
                user,
                place,
                cause,
                "etcd takes the password no more: it has been changed there. Write it here, too; it is read again and again"
            );
        }
        is_changed
    }

    /// Returns the request for a token. The password is read each time, since it may have been changed.
    pub(super) fn request(&self) -> Result<String, String> {
        Ok(json!({ "name": self.user.name, "password": self.password()? }).to_string())
    }

    /// Returns the user and the place of the password, for people to read.
    pub(super) fn described(&self) -> String {
        format!("user {} with the password of {}", self.user.name, self.place())
    }

    /// Returns the place of the password, for people to read.
    pub(super) fn place(&self) -> String {
        match &self.user.password_file {
            Some(file) => file.display().to_string(),
            None => format!("the environment's {ENVIRONMENT}"),
        }
    }

    fn password(&self) -> Result<String, String> {
        let password = match &self.user.password_file {
            Some(file) => std::fs::read_to_string(file).map_err(|error| error.to_string())?,
            None => std::env::var(ENVIRONMENT)
                .map_err(|error| format!("{error}; set it, or write password-file=FILE behind the user"))?,
        };
        // Drops the line end that an editor adds.
        let password = password.strip_suffix('\n').unwrap_or(&password);
        let password = password.strip_suffix('\r').unwrap_or(password);
        if password.is_empty() {
            return Err("it is empty, and holds no password".to_owned());
        }
        Ok(password.to_owned())
    }

    fn lock(&self) -> MutexGuard<'_, Option<String>> {
        self.token.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Does not show the token.
impl std::fmt::Debug for Login {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Login").field("user", &self.user).finish_non_exhaustive()
    }
}
