//! When two balls, or a ball and a wall, meet; and what a collision does to their velocities.
//!
//! Predictions are pure functions of trajectories, so every engine that asks gets the same instant, whenever it asks. They
//! tolerate overlap: balls that touch or overlap collide now if they approach and never if they do not, which is what keeps
//! rounding from letting a pair pass through each other.
//!
//! Source: Bannerman, Strobl, Formella, Poeschel, Comput. Part. Mech. 1, 191 (2014), for the treatment of overlap;
//! Haines, Guenther, Akenine-Moeller, Ray Tracing Gems (2019) ch. 7, for the discriminant without cancellation.

use glam::DVec3;

use crate::domain::Plane;
use crate::state::{Time, Trajectory};

/// Share of `|r|^2 |v|^2` by which the quick rejection may be wrong through rounding, with a wide margin.
pub const REJECTION_MARGIN: f64 = 1e-12;

/// When two balls whose centres are `contact` apart at contact meet, if both fly on freely.
///
/// Symmetric in its two trajectories, bit for bit. Balls that already overlap and approach meet at the later of their begins.
#[inline(always)]
pub fn pair_time(first: &Trajectory, second: &Trajectory, contact: f64) -> Option<Time> {
    let (begin, separation) = separation_at_later_begin(first, second);
    begin.after(approach_time(
        separation,
        first.velocity - second.velocity,
        contact,
    )?)
}

/// Like [`pair_time`], with the first ball moved by `shift`, to one of its images in a periodic box.
#[inline]
pub fn image_pair_time(
    first: &Trajectory,
    second: &Trajectory,
    contact: f64,
    shift: DVec3,
) -> Option<Time> {
    let (begin, separation) = separation_at_later_begin(first, second);
    begin.after(approach_time(
        separation + shift,
        first.velocity - second.velocity,
        contact,
    )?)
}

/// The later begin of two flights, and the way from the second ball to the first then.
#[inline(always)]
pub fn separation_at_later_begin(first: &Trajectory, second: &Trajectory) -> (Time, DVec3) {
    let lead = first.begin.since(second.begin);
    // One ball is at its reference, the other has flown since its own.
    let position =
        |trajectory: &Trajectory, flown: f64| trajectory.position + trajectory.velocity * flown;
    let separation = position(first, (-lead).max(0.0)) - position(second, lead.max(0.0));
    (
        if lead < 0.0 {
            second.begin
        } else {
            first.begin
        },
        separation,
    )
}

/// Whether two points at `separation`, moving apart with `velocity`, may come as near as `contact`: they approach and do not miss
/// each other by far.
///
/// It asks without a branch: most pairs do not meet, and which do cannot be foreseen.
#[inline(always)]
pub fn may_meet(separation: DVec3, velocity: DVec3, contact: f64) -> bool {
    let radial = separation.dot(velocity);
    let distance_squared = separation.length_squared();
    let speed_squared = velocity.length_squared();
    let beyond = distance_squared - contact * contact;
    let misses = radial * radial + REJECTION_MARGIN * distance_squared * speed_squared
        < speed_squared * beyond;
    (radial < 0.0) & !misses
}

/// Time until two points at `separation`, moving apart with `velocity`, are `contact` apart; `None` if never.
///
/// Zero if they are closer than that and approach.
#[inline(always)] // the rejection must stand in the caller's loop: most pairs end there
pub fn approach_time(separation: DVec3, velocity: DVec3, contact: f64) -> Option<f64> {
    if may_meet(separation, velocity, contact) {
        contact_time(separation, velocity, contact)
    } else {
        None
    }
}

/// The rest of [`approach_time`], for points that approach and do not miss by far.
#[inline(never)]
pub fn contact_time(separation: DVec3, velocity: DVec3, contact: f64) -> Option<f64> {
    let radial = separation.dot(velocity);
    let speed_squared = velocity.length_squared();
    let distance = separation.length();
    let gap = distance - contact;
    if gap <= 0.0 {
        // Two points at one place are not in each other's way.
        return (contact > 0.0).then_some(0.0);
    }
    let closest_approach = separation - velocity * (radial / speed_squared);
    let depth = contact - closest_approach.length();
    if !(depth > 0.0) {
        return None;
    }
    let discriminant = speed_squared * depth * (contact + (contact - depth));
    Some(gap * (distance + contact) / (discriminant.sqrt() - radial))
}

/// When a ball reaches the coordinate `limit` along `axis`, flying with positive speed for a positive `limit` side.
///
/// A ball at or beyond the limit and still moving outwards is there at its begin. `None` if it never arrives.
#[inline]
pub fn wall_time(trajectory: &Trajectory, axis: usize, limit: f64) -> Option<Time> {
    let speed = trajectory.velocity[axis];
    if speed == 0.0 {
        return None;
    }
    trajectory
        .begin
        .after(((limit - trajectory.position[axis]) / speed).max(0.0))
}

/// When a ball touches a plane, from the side it is on (`upper`: the side that the normal points to).
///
/// A ball that touches or reaches through it and moves on towards the other side is there at its begin. `None` if it recedes
/// or flies parallel.
#[inline]
pub fn plane_time(
    trajectory: &Trajectory,
    plane: &Plane,
    upper: bool,
    radius: f64,
) -> Option<Time> {
    let side = if upper { 1.0 } else { -1.0 };
    let approach = -side * plane.normal.dot(trajectory.velocity);
    if !(approach > 0.0) {
        return None;
    }
    let gap = side * plane.distance(trajectory.position) - radius;
    trajectory.begin.after((gap / approach).max(0.0))
}

/// Velocity after an elastic collision with a plane, from the side the ball is on.
///
/// The normal component gets the sign that leads away: a repeated event cannot push the ball through.
#[inline]
pub fn reflect(velocity: DVec3, plane: &Plane, upper: bool) -> DVec3 {
    let normal_speed = plane.normal.dot(velocity);
    let away = if upper {
        normal_speed.abs()
    } else {
        -normal_speed.abs()
    };
    velocity + plane.normal * (away - normal_speed)
}

/// Velocities after an elastic collision of two balls, `separation` being the first centre minus the second.
///
/// Divides by the actual square of the normal, so energy is conserved to rounding even if the balls do not touch exactly. With
/// unequal masses the heavier ball is computed first, which keeps the energy to 1e-13 even at a mass ratio of 1e14.
#[inline]
pub fn collide(separation: DVec3, velocities: [DVec3; 2], masses: [f64; 2]) -> [DVec3; 2] {
    let [first, second] = velocities;
    if masses[0] < masses[1] {
        let [second, first] = collide(-separation, [second, first], [masses[1], masses[0]]);
        return [first, second];
    }
    // Its largest component is one: along an axis nothing that is exchanged is rounded.
    let normal = separation / separation.abs().max_element();
    let normal_squared = normal.length_squared();
    if masses[0] == masses[1] {
        let exchanged = normal * ((first - second).dot(normal) / normal_squared);
        return [first - exchanged, second + exchanged];
    }
    let heavy = first.dot(normal);
    let light = second.dot(normal);
    let relative = light - heavy;
    // For an infinite mass the share is zero.
    let share = if masses[0].is_infinite() {
        0.0
    } else {
        2.0 * masses[1] / (masses[0] + masses[1])
    };
    let heavy_after = heavy + share * relative;
    let light_after = heavy_after - relative;
    [
        first + normal * ((heavy_after - heavy) / normal_squared),
        second + normal * ((light_after - light) / normal_squared),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight(position: [f64; 3], velocity: [f64; 3], local: f64) -> Trajectory {
        Trajectory {
            position: position.into(),
            velocity: velocity.into(),
            begin: Time { epoch: 0, local },
        }
    }

    #[track_caller]
    fn check_approach(separation: [f64; 3], velocity: [f64; 3], expected: Option<f64>) {
        assert_eq!(
            approach_time(separation.into(), velocity.into(), 1.0),
            expected
        );
    }

    #[test]
    fn head_on_balls_meet_when_the_gap_is_flown() {
        check_approach([3.0, 0.0, 0.0], [-0.5, 0.0, 0.0], Some(4.0));
    }

    #[test]
    fn receding_resting_and_passing_balls_never_meet() {
        check_approach([3.0, 0.0, 0.0], [0.5, 0.0, 0.0], None);
        check_approach([3.0, 0.0, 0.0], [0.0, 0.0, 0.0], None);
        check_approach([3.0, 0.0, 0.0], [0.0, 1.0, 0.0], None);
        check_approach([3.0, 1.01, 0.0], [-1.0, 0.0, 0.0], None);
    }

    #[test]
    fn overlapping_balls_collide_now_if_they_approach_and_never_if_not() {
        for depth in [1e-16, 1e-12, 1e-3, 0.5] {
            check_approach([1.0 - depth, 0.0, 0.0], [-1.0, 0.5, 0.0], Some(0.0));
            check_approach([1.0 - depth, 0.0, 0.0], [1.0, 0.5, 0.0], None);
            check_approach([1.0 - depth, 0.0, 0.0], [0.0, 0.5, 0.0], None);
        }
    }

    #[test]
    fn grazing_pairs_are_told_apart_down_to_a_millionth_of_a_millionth() {
        for exponent in 3..=12 {
            let margin = 10.0_f64.powi(-exponent);
            let meets = |impact| {
                approach_time(
                    DVec3::new(3.0, impact, 0.0),
                    DVec3::new(-1.0, 0.0, 0.0),
                    1.0,
                )
                .is_some()
            };
            assert!(meets(1.0 - margin), "1 - {margin}");
            assert!(!meets(1.0 + margin), "1 + {margin}");
        }
    }

    #[test]
    fn a_pair_time_does_not_depend_on_the_order_of_the_pair_or_on_when_it_is_asked() {
        let first = flight([0.3, 0.1, -0.2], [0.05, 0.02, 0.01], 0.25);
        let second = flight([0.5, 0.15, -0.19], [-0.07, 0.0, 0.02], 0.125);
        let time = pair_time(&first, &second, 0.1).expect("they meet");
        assert_eq!(pair_time(&second, &first, 0.1), Some(time));
        let gap = (first.position_at(time) - second.position_at(time)).length() - 0.1;
        assert!(gap.abs() < 1e-15, "{gap}");
    }

    #[test]
    fn equal_masses_head_on_swap_their_velocities_bit_for_bit() {
        let after = collide(
            DVec3::X * 0.5,
            [DVec3::X * -0.75, DVec3::X * 0.25],
            [1.0, 1.0],
        );
        assert_eq!(after, [DVec3::X * 0.25, DVec3::X * -0.75]);
    }

    #[test]
    fn a_collision_keeps_energy_and_momentum_at_any_mass_ratio_and_in_any_order() {
        let separation = DVec3::new(0.3, -0.5, 0.81);
        let velocities = [DVec3::new(-0.3, 0.2, 0.1), DVec3::new(0.4, -0.1, 0.6)];
        for ratio in [1.0, 3.0, 16.0, 1e6, 1e12] {
            let masses = [1.0, ratio];
            let after = collide(separation, velocities, masses);
            let energy = |v: [DVec3; 2]| {
                masses[0] * v[0].length_squared() + masses[1] * v[1].length_squared()
            };
            let momentum = |v: [DVec3; 2]| masses[0] * v[0] + masses[1] * v[1];
            assert!((energy(after) / energy(velocities) - 1.0).abs() < 1e-15 * 4.0);
            assert!((momentum(after) - momentum(velocities)).length() < 1e-15 * 4.0 * ratio);
            let [second, first] =
                collide(-separation, [velocities[1], velocities[0]], [ratio, 1.0]);
            assert_eq!(after, [first, second]);
        }
    }

    #[test]
    fn an_infinite_mass_is_a_wall() {
        let after = collide(
            DVec3::X,
            [DVec3::ZERO, DVec3::new(0.5, 0.25, 0.0)],
            [f64::INFINITY, 1.0],
        );
        assert_eq!(after, [DVec3::ZERO, DVec3::new(-0.5, 0.25, 0.0)]);
    }

    #[test]
    fn a_plane_is_met_from_either_side_at_the_balls_radius() {
        let plane = Plane {
            normal: DVec3::new(0.6, 0.8, 0.0),
            offset: 0.5,
        };
        let above = flight([0.6 * 3.5, 0.8 * 3.5, 7.0], [-0.6, -0.8, 2.0], 0.0);
        assert!(
            (plane_time(&above, &plane, true, 1.0)
                .expect("it comes")
                .relative_to(0)
                - 2.0)
                .abs()
                < 1e-14
        );
        assert_eq!(plane_time(&above, &plane, false, 1.0), None);
        let below = flight([-0.6, -0.8, 0.0], [0.6, 0.8, 0.0], 0.0);
        assert!(
            (plane_time(&below, &plane, false, 0.5)
                .expect("it comes")
                .relative_to(0)
                - 1.0)
                .abs()
                < 1e-14
        );
        let after = reflect(above.velocity, &plane, true);
        assert!((after - DVec3::new(0.6, 0.8, 2.0)).length() < 1e-15);
        assert!(
            (reflect(after, &plane, true) - after).length() < 1e-15,
            "a repeated event changes nothing"
        );
    }

    #[test]
    fn a_ball_beyond_the_wall_and_moving_outwards_is_there_now() {
        let begin = Time {
            epoch: 0,
            local: 0.5,
        };
        assert_eq!(
            wall_time(&flight([1.0, 0.0, 0.0], [0.5, 0.0, 0.0], 0.5), 0, 1.0),
            Some(begin)
        );
        assert_eq!(
            wall_time(&flight([1.5, 0.0, 0.0], [0.5, 0.0, 0.0], 0.5), 0, 1.0),
            Some(begin)
        );
        assert_eq!(
            wall_time(&flight([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 0.5), 0, 1.0),
            None
        );
        assert_eq!(
            wall_time(&flight([0.0, 0.0, 0.0], [-0.5, 0.0, 0.0], 0.5), 0, -1.0),
            Some(Time {
                epoch: 2,
                local: 0.5
            })
        );
    }
}
