//! Finds the largest clique of a graph by branch and bound (Tomita and Seki 2003; in bits, San Segundo et al.
//! 2011): nodes of the same colour are pairwise not near, so a clique has at most as many nodes as its
//! candidates have colours.

use super::near::{Graph, Ranks};

/// The number of words of bits that the searches of one grouping may go over, beyond the fixed cost of each
/// group: 30 to 60 ms.
const WORK: u64 = 50_000_000;

/// The work that is left, in words of bits.
#[derive(Debug)]
pub(super) struct Work(u64);

impl Default for Work {
    fn default() -> Self {
        Self(WORK)
    }
}

impl Work {
    /// Lends one of so many rounds its share. What the round leaves is for the others.
    pub(super) fn share<T>(&mut self, rounds: usize, round: impl FnOnce(&mut Self) -> T) -> T {
        let share = self.0 / rounds.max(1) as u64;
        let mut lent = Self(share);
        let result = round(&mut lent);
        self.0 -= share - lent.0;
        result
    }

    /// Pays for this much work. Returns false when nothing is left.
    fn pay(&mut self, words: usize) -> bool {
        self.0 = self.0.saturating_sub(words as u64);
        self.0 > 0
    }
}

/// Returns a clique to which no node of `among` can be added, lowest ranks first. It is empty only if `among`
/// is.
pub(super) fn greedy(graph: &Graph, among: &Ranks) -> Vec<usize> {
    let mut clique = Vec::new();
    graph.complete(&mut clique, among);
    clique
}

/// Returns the largest clique of `among`, or any of `enough` nodes, if it is larger than `best`; else `best`.
/// When the work is spent, returns the largest seen.
pub(super) fn largest(
    graph: &Graph,
    among: &Ranks,
    enough: usize,
    best: Vec<usize>,
    work: &mut Work,
) -> Vec<usize> {
    let mut search = Search { graph, enough, best, chosen: Vec::new(), work };
    let candidates = search.worthwhile(among);
    search.branch(candidates);
    search.best
}

struct Search<'a> {
    graph: &'a Graph,
    enough: usize,
    best: Vec<usize>,
    chosen: Vec<usize>,
    work: &'a mut Work,
}

impl Search<'_> {
    /// Returns the nodes that have as many near them as a clique larger than the best needs.
    fn worthwhile(&mut self, among: &Ranks) -> Ranks {
        let mut kept = among.clone();
        let mut before = usize::MAX;
        while kept.len() < before {
            before = kept.len();
            for rank in kept.clone().iter() {
                if self.graph.near(rank).common(&kept) < self.best.len() {
                    kept.remove(rank);
                }
            }
            if !self.work.pay(before * among.words()) {
                break;
            }
        }
        kept
    }

    /// Tries all cliques of the chosen and candidates that could be larger than the best.
    fn branch(&mut self, mut candidates: Ranks) {
        if self.chosen.len() > self.best.len() {
            self.best.clone_from(&self.chosen);
        }
        if self.best.len() >= self.enough || candidates.is_empty() {
            return;
        }
        for (rank, colours) in self.coloured(&candidates).into_iter().rev() {
            let done = self.best.len() >= self.enough || self.chosen.len() + colours <= self.best.len();
            if done || !self.work.pay(candidates.words()) {
                return;
            }
            self.chosen.push(rank);
            self.branch(candidates.and(self.graph.near(rank)));
            self.chosen.pop();
            candidates.remove(rank);
        }
    }

    /// Returns the candidates in the order of their colours, each with the number of colours up to its own.
    /// Candidates are left out if their colours are so few that no larger clique begins with them.
    fn coloured(&mut self, candidates: &Ranks) -> Vec<(usize, usize)> {
        let too_few = self.best.len().saturating_sub(self.chosen.len());
        let mut coloured = Vec::new();
        let mut plain = candidates.clone();
        let mut colours = 0;
        let mut spent = 0;
        while !plain.is_empty() {
            colours += 1;
            let mut free = plain.clone();
            let mut next = free.first_from(0);
            while let Some(rank) = next {
                plain.remove(rank);
                free.drop(self.graph.near(rank));
                if colours > too_few {
                    coloured.push((rank, colours));
                }
                spent += candidates.words();
                next = free.first_from(rank + 1);
            }
            spent += candidates.words();
        }
        self.work.pay(spent);
        coloured
    }
}
