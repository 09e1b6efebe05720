//! Finds company for nodes that groups of 2^k nodes leave alone: such a node joins a group, takes a member of
//! one that can spare it, or takes half of a pair, whose other half then looks for company in the same way.
//! Along such chains (augmenting paths) every node finds company that can: if another division into groups
//! leaves fewer alone, a chain leads towards it.

use super::near::{Graph, Ranks};

/// The number of nodes that all chains together may look at. Graphs of ten nodes never need so many.
const WORK: u64 = 4_000_000;

/// Gives company to as many lone nodes as it can. Among the ways to do so it prefers those that keep sizes
/// powers of two.
pub(super) fn give_company(graph: &Graph, groups: &mut Vec<Vec<usize>>, max_size: usize) {
    let alone: Vec<usize> = groups.iter().filter(|group| group.len() == 1).map(|group| group[0]).collect();
    let mut group_of = vec![0; graph.len()];
    for (at, group) in groups.iter().enumerate() {
        group.iter().for_each(|&rank| group_of[rank] = at);
    }
    let mut left = WORK;
    let mut places = Places { graph, groups, group_of, max_size, work: 0, touched: graph.none() };
    for (done, &rank) in alone.iter().enumerate() {
        if places.groups[places.group_of[rank]].len() > 1 {
            continue; // Another node has taken it for company.
        }
        let share = left / (alone.len() - done) as u64;
        places.work = share;
        places.touched = graph.none();
        places.find_company(rank);
        left -= share - places.work;
    }
    groups.retain(|group| !group.is_empty());
}

struct Places<'a> {
    graph: &'a Graph,
    groups: &'a mut Vec<Vec<usize>>,
    group_of: Vec<usize>,
    max_size: usize,
    work: u64,
    /// The nodes of pairs that this chain has parted.
    touched: Ranks,
}

/// A way to find company for a node that is alone, worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Way {
    /// Take a member of a group of four or more.
    TakeFromMany(usize),
    /// Join a group whose size is then no power of two.
    Join(usize),
    /// Take a member of a group of three, which makes two pairs.
    TakeFromThree(usize),
    /// Join a group that will have 2^k members.
    JoinWell(usize),
    /// Join another node that is alone.
    JoinOne(usize),
}

impl Places<'_> {
    /// Finds company for a node that is alone, or changes nothing.
    fn find_company(&mut self, rank: usize) -> bool {
        let near: Vec<usize> = self.graph.near(rank).iter().collect();
        self.work = self.work.saturating_sub(near.len() as u64 + 1);
        if let Some(way) = near.iter().filter_map(|&other| self.way(rank, other)).max() {
            match way {
                Way::JoinOne(other) | Way::JoinWell(other) | Way::Join(other) => self.put(rank, other),
                Way::TakeFromThree(other) | Way::TakeFromMany(other) => self.put(other, rank),
            }
            return true;
        }
        for other in near {
            // Each near node is in a pair, or there would be a way.
            if self.work == 0 || self.max_size < 2 || self.touched.contains(other) {
                continue;
            }
            let home = self.group_of[other];
            let parted: Vec<usize> = self.groups[home].clone();
            let third = if parted[0] == other { parted[1] } else { parted[0] };
            let alone = self.group_of[rank];
            parted.iter().for_each(|&one| self.touched.insert(one));
            self.put(other, rank);
            if self.find_company(third) {
                return true;
            }
            parted.iter().for_each(|&one| self.touched.remove(one));
            self.put_into(other, home);
            debug_assert_eq!(self.groups[alone], [rank], "undone");
        }
        false
    }

    /// Returns what the group of a near node can do at once.
    fn way(&self, rank: usize, other: usize) -> Option<Way> {
        let group = &self.groups[self.group_of[other]];
        let size = group.len();
        let joins = size < self.max_size && group.iter().all(|&one| self.graph.near(rank).contains(one));
        match size {
            1 if joins => Some(Way::JoinOne(other)),
            _ if joins && (size + 1).is_power_of_two() => Some(Way::JoinWell(other)),
            3 => Some(Way::TakeFromThree(other)),
            _ if joins => Some(Way::Join(other)),
            4.. => Some(Way::TakeFromMany(other)),
            _ => None,
        }
    }

    fn put(&mut self, rank: usize, with: usize) {
        self.put_into(rank, self.group_of[with]);
    }

    fn put_into(&mut self, rank: usize, group: usize) {
        self.groups[self.group_of[rank]].retain(|&one| one != rank);
        self.groups[group].push(rank);
        self.group_of[rank] = group;
    }
}
