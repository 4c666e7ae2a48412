//! The numbers of particles in what is written: those of the list, then those of the nets, net after net; those that
//! came to be where a net tore after all others.

use bevy_mass_spring::scene::MassSpringScene;

/// Where the particles of each net are numbered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Numbering {
    nets: Vec<Numbers>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Numbers {
    /// The number of its first particle.
    start: usize,
    /// How many it had at the start.
    count: usize,
    /// The number of the first of those that it has got since.
    new_start: usize,
    new_count: usize,
}

impl Numbering {
    /// Numbers the particles of `scene`; `present` is the present number of particles of each net.
    pub fn new(scene: &MassSpringScene, present: impl Iterator<Item = usize>) -> Self {
        let (mut start, mut new_start) = (scene.particles.len(), scene.particle_count());
        let nets = scene.nets.iter().zip(present).map(|(net, present)| {
            let count = net.particle_count();
            let numbers = Numbers { start, count, new_start, new_count: present.saturating_sub(count) };
            start += count;
            new_start += numbers.new_count;
            numbers
        });
        Self { nets: nets.collect() }
    }

    /// The number of a particle of a net.
    pub fn number(&self, net: usize, particle: usize) -> usize {
        let Numbers { start, count, new_start, .. } = self.nets[net];
        if particle < count { start + particle } else { new_start + (particle - count) }
    }

    /// Calls `found` with the net of each particle and its number there, in the order of numbers.
    pub fn for_each(&self, mut found: impl FnMut(usize, usize)) {
        for (net, numbers) in self.nets.iter().enumerate() {
            (0..numbers.count).for_each(|particle| found(net, particle));
        }
        for (net, numbers) in self.nets.iter().enumerate() {
            (0..numbers.new_count).for_each(|particle| found(net, numbers.count + particle));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn new_particles_come_after_all_others() {
        let rope =
            "Rope(from: (0, 0, 0), to: (1, 0, 0), segments: 1, linear_density: 1, stretch_stiffness: 1)";
        let scene = MassSpringScene::from_ron(&format!(
            "(particles: [(position: (0, 1, 0), mass: 1)], nets: [{rope}, {rope}])"
        ))
        .unwrap();
        let numbering = Numbering::new(&scene, [4, 3].into_iter());
        let mut order = Vec::new();
        numbering.for_each(|net, particle| {
            assert_eq!(numbering.number(net, particle), 1 + order.len());
            order.push((net, particle));
        });
        assert_eq!(order, [(0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (0, 3), (1, 2)]);
    }
}
