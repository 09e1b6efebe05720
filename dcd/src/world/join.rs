//! Joins and serves worlds: constructors of [`World`] for clients, participants, nodes and servers, and join tokens.

use std::net::SocketAddr;
use std::time::Duration;

use super::hosted::{Hosted, Process};
use super::remote::Remote;
use super::role::Instead;
use super::served::Served;
use super::{Error, Inner, World};
use crate::net::JoinRole;
use crate::runtime::{
    Beginning, ClientWorld, JoinConfig, Member, MemberConfig, Origin, ServeConfig, ServerProcess, WorldConfig,
};
use crate::scene::Scene;

const TOKENS: &str = "mint tokens";

/// Joining and serving.
impl World {
    /// Joins a served world as a client, and waits until the server has sent the whole world. It need not have nodes yet: the
    /// world stands still until it has. Dropping the world leaves it; avatars wait at the server for the return with the same
    /// identity.
    pub fn connect(config: &JoinConfig) -> Result<Self, Error> {
        Ok(Self::of(Served::new(ClientWorld::connect(config)?)?))
    }

    /// Joins a served world as a client whose process also computes regions of it, on threads of its own. Dropping the world
    /// first hands these regions to others, which may take some seconds.
    pub fn participate(config: &JoinConfig) -> Result<Self, Error> {
        Ok(Self::of(Served::new(ClientWorld::participate(config)?)?))
    }

    /// Joins a served world as a node: this process computes regions of it for others, on threads of its own. Dropping the world
    /// first hands these regions to others.
    pub fn join_as_node(config: &JoinConfig) -> Result<Self, Error> {
        let mut member = MemberConfig::new(config.server, config.join(JoinRole::Node)?);
        member.standbys.clone_from(&config.standbys);
        member.threads = config.threads;
        member.give_up = config.give_up.or(member.give_up);
        member.listen = config.listen;
        member.advertise = config.advertise;
        member.record.clone_from(&config.record);
        member.metrics = config.metrics;
        Ok(Self::of(Hosted::new(Process::Node(Member::start(member)?), None)))
    }

    /// Serves a scene: the world begins with the nodes that join. Of `world` only the cut and the step settings count. Dropping
    /// the server ends the world for all; [`World::suspend`] keeps it.
    pub fn serve(scene: &Scene, world: &WorldConfig, config: ServeConfig) -> Result<Self, Error> {
        let server = ServerProcess::start(Origin::Scene(scene, world), config)?;
        Ok(Self::of(Hosted::new(Process::Server(server), Some(world.step))))
    }

    /// Serves a copy of this local world as it is now, with its cut and settings. What is not a property of a body or joint stays
    /// behind: contacts under load begin anew, and the tick begins at 0.
    pub fn serve_copy(&self, config: ServeConfig) -> Result<Self, Error> {
        self.copy_to_serve()?(config)
    }

    /// Returns what does the rest of [`World::serve_copy`] and needs this world no more: it may stand by for long.
    #[doc(hidden)]
    pub fn copy_to_serve(&self) -> Result<impl FnOnce(ServeConfig) -> Result<Self, Error> + use<>, Error> {
        let source = self.local("be a source", Instead::MakeSourceAnew)?;
        let (beginning, step) = (Beginning::of(Origin::World(source))?, self.settings()?);
        Ok(move |config| {
            let server = ServerProcess::start_from(beginning, config)?;
            Ok(Self::of(Hosted::new(Process::Server(server), Some(step))))
        })
    }

    /// Stops this server without ending its world: what is known of it is written to the data folder, nodes compute on and dial
    /// a server that is started again in the same way, for half a minute, and clients do. From here on every step is an
    /// error. Dropping a server that was not suspended ends its world for all.
    ///
    /// # Errors
    /// [`Unsupported`](super::Unsupported) in other roles.
    pub fn suspend(&mut self) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(_) => Err(self.refuse("be suspended", Instead::Serve)),
            Inner::Remote(world) => world.suspend(),
        }
    }

    /// Mints a token that lets one process join this server in such a role, within `valid_for`.
    pub fn token(&self, role: JoinRole, valid_for: Duration) -> Result<String, Error> {
        Ok(self.server(TOKENS)?.token(role, valid_for)?)
    }

    /// Returns an error if this process mints no tokens.
    #[doc(hidden)]
    pub fn mints_tokens(&self) -> Result<(), Error> {
        self.server(TOKENS).map(drop)
    }

    fn server(&self, what: &'static str) -> Result<&ServerProcess, Error> {
        self.has_network(what)?;
        let server = self.remote().and_then(|world| world.server());
        server.ok_or_else(|| self.refuse(what, Instead::AskServer))
    }

    /// Returns the address at which a server or a node listens.
    pub fn address(&self) -> Result<SocketAddr, Error> {
        let what = "be listened to";
        let Some(world) = self.remote() else { return Err(self.refuse(what, Instead::Serve)) };
        world.address().ok_or_else(|| self.refuse(what, Instead::AskListener))
    }

    /// Returns the address at which a server, a node or a participant tells of itself ([`ServeConfig::metrics`], [`JoinConfig::metrics`]): where
    /// port 0 was asked for, with the port that it was given. `None` if it does not.
    pub fn metrics_address(&self) -> Option<SocketAddr> {
        self.remote()?.metrics_address()
    }

    fn of(world: impl Remote + 'static) -> Self {
        Self::with(Inner::Remote(Box::new(world)))
    }
}
