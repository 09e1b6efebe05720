//! Joins and serves worlds: holds the constructors of [`World`] for clients, participants, nodes and servers,
//! and mints join tokens.

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
    /// Joins a served world as a client, and waits until the server has sent the whole world, or the area of
    /// interest to begin with. The token decides whether the client is a builder. The world need not have
    /// nodes yet: it stands still until it has.
    ///
    /// Dropping the returned world leaves the served one. Avatars wait at the server for the client's return
    /// with the same identity ([`JoinConfig::identity`]).
    pub fn connect(config: &JoinConfig) -> Result<Self, Error> {
        Ok(Self::of(Served::new(ClientWorld::connect(config)?)?))
    }

    /// Joins a served world as a participant: a client whose process also computes regions of the world, on
    /// threads of its own. Dropping the returned world first hands these regions to others, which may take
    /// some seconds.
    pub fn participate(config: &JoinConfig) -> Result<Self, Error> {
        Ok(Self::of(Served::new(ClientWorld::participate(config)?)?))
    }

    /// Joins a served world as a node: this process computes regions of the world for others, on threads of
    /// its own. Dropping the returned world first hands these regions to others.
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

    /// Serves a scene: the world begins to run with the nodes that join. All of `world` counts but `threads`.
    /// Dropping the server ends the world for all; [`World::suspend`] keeps it.
    pub fn serve(scene: &Scene, world: &WorldConfig, config: ServeConfig) -> Result<Self, Error> {
        let server = ServerProcess::start(Origin::Scene(scene, world), config)?;
        Ok(Self::of(Hosted::new(Process::Server(server), Some(world.step))))
    }

    /// Serves a copy of this local world as it is now, with its cut and settings. Only the properties of
    /// bodies and joints are copied: contacts under load begin anew, and the tick begins at 0.
    pub fn serve_copy(&self, config: ServeConfig) -> Result<Self, Error> {
        self.copy_to_serve()?(config)
    }

    /// Returns a function that does the rest of [`World::serve_copy`]. It does not need this world any more,
    /// and may be called much later: a standby server waits in it.
    #[doc(hidden)]
    pub fn copy_to_serve(&self) -> Result<impl FnOnce(ServeConfig) -> Result<Self, Error> + use<>, Error> {
        let source = self.local("be a source", Instead::MakeSourceAnew)?;
        let (beginning, step) = (Beginning::of(Origin::World(source))?, self.settings()?);
        Ok(move |config| {
            let server = ServerProcess::start_from(beginning, config)?;
            Ok(Self::of(Hosted::new(Process::Server(server), Some(step))))
        })
    }

    /// Stops this server without ending its world, and writes what it knows of the world to the data folder.
    /// Nodes go on computing, and all processes dial a server that is started again with the same settings:
    /// nodes and participants without end, clients for half a minute, unless [`JoinConfig::give_up`] says
    /// otherwise. From now on every step returns an error. Dropping a server that was not suspended ends its
    /// world for all.
    ///
    /// # Errors
    /// [`Unsupported`](super::Unsupported) in other roles.
    pub fn suspend(&mut self) -> Result<(), Error> {
        match &mut self.inner {
            Inner::Local(_) => Err(self.refuse("be suspended", Instead::Serve)),
            Inner::Remote(world) => world.suspend(),
        }
    }

    /// Mints a token that lets one process join this server in a role, within `valid_for` from now.
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

    /// Returns the address at which a server or a node listens; an error in other roles.
    pub fn address(&self) -> Result<SocketAddr, Error> {
        let what = "be listened to";
        let Some(world) = self.remote() else { return Err(self.refuse(what, Instead::Serve)) };
        world.address().ok_or_else(|| self.refuse(what, Instead::AskListener))
    }

    /// Returns the address of the metrics endpoint of a server, a node or a participant
    /// ([`ServeConfig::metrics`], [`JoinConfig::metrics`]), with the port in use where port 0 was asked for.
    /// `None` if there is no endpoint.
    pub fn metrics_address(&self) -> Option<SocketAddr> {
        self.remote()?.metrics_address()
    }

    fn of(world: impl Remote + 'static) -> Self {
        Self::with(Inner::Remote(Box::new(world)))
    }
}
