// SPDX-License-Identifier: BSD-3-Clause
#include "flight.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <Eigen/LU>

namespace situation_awareness {
namespace {

/// A compromise: few legs for a day of flight, and few steps to integrate again for an earlier time.
constexpr long kStepsOfLeg = 2500;
constexpr double kLost_m = 10.0;  ///< farther from its path the robot is lost

/// Rotation of the vector's direction by its length.
Eigen::Quaterniond exponential(const Eigen::Vector3d& rotation_rad) {
  const double angle_rad = rotation_rad.norm();
  if (angle_rad < 1e-12) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, rotation_rad / angle_rad));
}

Eigen::Vector3d logarithm(const Eigen::Quaterniond& q) {
  const Eigen::AngleAxisd turn(q.w() < 0.0 ? Eigen::Quaterniond(-q.coeffs()) : q);
  return turn.angle() * turn.axis();
}

/// w = J(phi) phi' is the angular velocity, in the turned axes, of exp(phi): the right Jacobian of SO(3) to third order
/// in phi, which between two steps is some hundredths of a radian.
Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi) {
  Eigen::Matrix3d skew;
  skew << 0.0, -phi.z(), phi.y(), phi.z(), 0.0, -phi.x(), -phi.y(), phi.x(), 0.0;
  const Eigen::Matrix3d skew2 = skew * skew;
  return Eigen::Matrix3d::Identity() - skew / 2.0 + skew2 / 6.0 - skew2 * skew / 24.0;
}

/// A cubic on [0, 1] with its values and derivatives at both ends, and its derivative.
struct Cubic {
  Eigen::Vector3d value, derivative;
};

Cubic cubic(const Eigen::Vector3d& p0, const Eigen::Vector3d& m0, const Eigen::Vector3d& p1, const Eigen::Vector3d& m1,
            double s) {
  const Eigen::Vector3d a = 2.0 * (p0 - p1) + m0 + m1, b = 3.0 * (p1 - p0) - 2.0 * m0 - m1;
  return {p0 + s * (m0 + s * (b + s * a)), m0 + s * (2.0 * b + 3.0 * s * a)};
}

Airframe airframe_of(const mjModel& model, int body) {
  const auto refuse = [](const std::string& reason) { throw std::runtime_error(reason); };
  const Eigen::Map<const Eigen::Vector3d> center_of_mass(model.body_ipos + 3 * body);
  if (center_of_mass.norm() > 1e-6) {
    refuse("the centre of mass of 'robot' is not its origin: give it <inertial pos=\"0 0 0\" mass=... />");
  }
  if (model.nu != 4) refuse("'robot' has a free joint and so needs four motors, not " + std::to_string(model.nu));
  if (model.opt.timestep > 0.005) refuse("option timestep is above 0.005 s, the most a flight can be integrated with");
  const Eigen::Map<const Eigen::Vector3d> gravity(model.opt.gravity);
  if ((gravity - Eigen::Vector3d(0.0, 0.0, -kGravity_m_s2)).norm() > 1e-9) refuse("option gravity is not 0 0 -9.81");

  Airframe airframe;
  airframe.mass_kg = model.body_mass[body];
  const Eigen::Map<const Eigen::Vector4d> iquat(model.body_iquat + 4 * body);
  const Eigen::Matrix3d axes = Eigen::Quaterniond(iquat[0], iquat[1], iquat[2], iquat[3]).toRotationMatrix();
  const Eigen::Map<const Eigen::Vector3d> moments(model.body_inertia + 3 * body);
  airframe.inertia_kg_m2 = axes * moments.asDiagonal() * axes.transpose();
  for (int i = 0; i < 4; ++i) {
    const std::string motor = "motor " + quoted_name(model, mjOBJ_ACTUATOR, i);
    const int site = model.actuator_trnid[2 * i];
    if (model.actuator_trntype[i] != mjTRN_SITE || model.site_bodyid[site] != body) {
      refuse(motor + " needs a site of 'robot' to push at");
    }
    if (model.actuator_dyntype[i] != mjDYN_FILTER || !(model.actuator_dynprm[mjNDYN * i] > 0.0)) {
      refuse(motor + " needs dyntype=\"filter\" with its lag in s as dynprm");
    }
    if (model.actuator_gaintype[i] != mjGAIN_FIXED || model.actuator_gainprm[mjNGAIN * i] != 1.0 ||
        model.actuator_biastype[i] != mjBIAS_NONE) {
      refuse(motor + " is not a plain one: its gain is 1 and it has no bias");
    }
    if (!model.actuator_ctrllimited[i]) refuse(motor + " needs ctrllimited=\"true\" and its ctrlrange in N");
    airframe.min_thrusts_N[i] = model.actuator_ctrlrange[2 * i];
    airframe.max_thrusts_N[i] = model.actuator_ctrlrange[2 * i + 1];

    const Eigen::Map<const Eigen::Vector4d> quat(model.site_quat + 4 * site);
    const Eigen::Matrix3d R = Eigen::Quaterniond(quat[0], quat[1], quat[2], quat[3]).toRotationMatrix();
    const Eigen::Map<const Eigen::Vector3d> place(model.site_pos + 3 * site);
    const Eigen::Map<const Eigen::Matrix<double, 6, 1>> gear(model.actuator_gear + 6 * i);
    const Eigen::Vector3d force = R * gear.head<3>();
    if (force.head<2>().norm() > 1e-6 || force.z() < 1e-6) refuse(motor + " does not push along z of 'robot'");
    airframe.wrench_of_motors.col(i) << force.z(), place.cross(force) + R * gear.tail<3>();
  }
  if (std::abs(airframe.wrench_of_motors.determinant()) < 1e-9) {
    refuse("the motors of 'robot' cannot turn it about all its axes");
  }
  const double weight_N = airframe.mass_kg * kGravity_m_s2;
  const double lift_N = airframe.wrench_of_motors.row(0) * airframe.max_thrusts_N;
  if (lift_N < 1.2 * weight_N) {
    refuse("the motors of 'robot' push with " + std::to_string(lift_N) + " N at most, and its weight is " +
           std::to_string(weight_N) + " N: they need 1.2 times that");
  }
  return airframe;
}

}  // namespace

Flight::Flight(const mjModel& model, int robot_body, ScriptedPath path, double drag_1_s)
    : model_(model),
      data_(mj_makeData(&model)),
      body_(robot_body),
      path_(std::move(path)),
      drag_1_s_(drag_1_s),
      step_s_(model.opt.timestep),
      airframe_(airframe_of(model, robot_body)) {
  if (!data_) throw std::runtime_error("not enough memory for its flight");
  leg_starts_.push_back(start());
}

Flight::State Flight::start() const {
  const PathState path = path_(0.0);
  const RobotState robot = multirotor_state(path, drag_1_s_);
  return {robot.T_world_robot.translation(), robot.velocity_world_m_s, Eigen::Quaterniond(robot.T_world_robot.linear()),
          robot.angular_velocity_robot_rad_s, motor_thrusts(airframe_, robot, path, drag_1_s_)};
}

Flight::State Flight::after(const State& state, long step) const {
  // MuJoCo's order for the free joint, the only one: position and quaternion; velocity in the world's axes and angular
  // velocity in the robot's. Its activations are the thrusts that the motors have reached.
  using Vector6d = Eigen::Matrix<double, 6, 1>;
  Eigen::Map<Eigen::Vector3d> position(data_->qpos);
  Eigen::Map<Eigen::Vector4d> quaternion(data_->qpos + 3);
  Eigen::Map<Vector6d> velocity(data_->qvel);
  Eigen::Map<Eigen::Vector4d> reached(data_->act);
  position = state.position_m;
  quaternion << state.q_world_robot.w(), state.q_world_robot.vec();
  velocity << state.velocity_m_s, state.angular_velocity_robot_rad_s;
  reached = state.thrusts_N;

  RobotState robot;
  robot.T_world_robot.linear() = state.q_world_robot.toRotationMatrix();
  robot.T_world_robot.translation() = state.position_m;
  robot.velocity_world_m_s = state.velocity_m_s;
  robot.angular_velocity_robot_rad_s = state.angular_velocity_robot_rad_s;
  Eigen::Map<Eigen::Vector4d>(data_->ctrl) =
      motor_thrusts(airframe_, robot, path_(static_cast<double>(step) * step_s_), drag_1_s_);
  Eigen::Map<Vector6d>(data_->xfrc_applied + 6 * body_).head<3>() = -airframe_.mass_kg * drag_1_s_ * state.velocity_m_s;
  mj_step(&model_, data_.get());

  return {position, velocity.head<3>(),
          Eigen::Quaterniond(quaternion[0], quaternion[1], quaternion[2], quaternion[3]).normalized(),
          velocity.tail<3>(), reached};
}

const std::vector<Flight::State>& Flight::steps_of_leg(long number, std::size_t count) const {
  while (static_cast<long>(leg_starts_.size()) <= number) {
    steps_of_leg(static_cast<long>(leg_starts_.size()) - 1, kStepsOfLeg + 1);
  }
  if (recent_legs_[0].number != number) std::swap(recent_legs_[0], recent_legs_[1]);
  Leg& leg = recent_legs_[0];
  if (leg.number != number) leg = {number, {leg_starts_[static_cast<std::size_t>(number)]}};
  if (leg.steps.size() >= count) return leg.steps;

  const MujocoThrows guard;
  while (leg.steps.size() < count) {
    leg.steps.push_back(after(leg.steps.back(), number * kStepsOfLeg + static_cast<long>(leg.steps.size()) - 1));
  }
  const bool is_whole = leg.steps.size() == kStepsOfLeg + 1;
  if (is_whole && static_cast<std::size_t>(number) + 1 == leg_starts_.size()) leg_starts_.push_back(leg.steps.back());
  return leg.steps;
}

RobotState Flight::at(double time_s) const {
  if (!(time_s > 0.0)) return multirotor_state(path_(time_s), drag_1_s_);
  const double steps = time_s / step_s_;
  const auto step = static_cast<long>(steps);
  const auto of_leg = static_cast<std::size_t>(step % kStepsOfLeg);
  const std::vector<State>& states = steps_of_leg(step / kStepsOfLeg, of_leg + 2);
  const State& a = states[of_leg];
  const State& b = states[of_leg + 1];
  if (!((a.position_m - path_(time_s).position_m).norm() < kLost_m)) {
    throw std::runtime_error("'robot' has left its path at " + std::to_string(time_s) +
                             " s: it is too fast for its motors");
  }

  const double s = steps - static_cast<double>(step);
  const Cubic place = cubic(a.position_m, step_s_ * a.velocity_m_s, b.position_m, step_s_ * b.velocity_m_s, s);
  const Eigen::Vector3d turn = logarithm(a.q_world_robot.conjugate() * b.q_world_robot);
  const Cubic turned = cubic(Eigen::Vector3d::Zero(), step_s_ * a.angular_velocity_robot_rad_s, turn,
                             step_s_ * right_jacobian(turn).inverse() * b.angular_velocity_robot_rad_s, s);
  RobotState robot;
  robot.T_world_robot.linear() = (a.q_world_robot * exponential(turned.value)).toRotationMatrix();
  robot.T_world_robot.translation() = place.value;
  robot.velocity_world_m_s = place.derivative / step_s_;
  robot.angular_velocity_robot_rad_s = right_jacobian(turned.value) * turned.derivative / step_s_;
  return robot;
}

}  // namespace situation_awareness
