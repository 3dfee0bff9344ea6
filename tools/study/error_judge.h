// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "sinew/formats/package.h"
#include "tools/study/error.h"
#include "tools/study/motion.h"

namespace sinew::tools {

/// Where the reference of a scene went, what counts of it, and how far off other motions are.
class ErrorJudge {
  using Vector3d = Eigen::Vector3d;
  using Vector3f = Eigen::Vector3f;

 public:
  ErrorJudge(const MotionScene& scene, const MotionBody& body, const std::vector<std::uint8_t>& counts,
             Motion reference, const formats::PackageView& package, double diagonal)
      : body_(body),
        reference_(std::move(reference)),
        first_(std::size_t(std::lround(scene.comparedFrom() / kFrameSeconds))),
        diagonal_(diagonal) {
    for (std::uint32_t v = 0; v < body.surface.size(); ++v) {
      if (counts[v] == 0) continue;
      vertices_.push_back(v);
      area_ += body.areas[v];
    }
    if (scene.free) {
      lying_ = reference_.frames;
      while (scene.ground && first_ + 1 < lying_.size() && lowest(lying_[first_]) > scene.ground->height) ++first_;
      reference_ = withoutRigid(std::move(reference_));
    }
    double square = 0, weight = 0;
    for (std::size_t frame = first_; frame < reference_.frames.size(); ++frame) {
      double here = 0;
      for (const std::uint32_t v : vertices_) {
        const double way = (reference_.frames[frame][v].cast<double>() - body.surface[v]).norm();
        here += body.areas[v] * way * way;
        if (way > largest_) {
          largest_ = way;
          widest_ = frame;
        }
      }
      square += here;
      weight += area_;
    }
    rms_ = std::sqrt(square / weight);
    end_ = meanOfEnd(reference_);
    double end = 0;
    for (const std::uint32_t v : vertices_) end += body.areas[v] * (end_[v] - body.surface[v]).squaredNorm();
    end_rms_ = std::sqrt(end / area_);
    setTriangles(package);
    if (scene.release) {
      before_ = reference_.frames[first_ - 1];
      swing_ = swingOf(reference_);
    }
  }

  double rms() const { return rms_ / diagonal_; }
  double largest() const { return largest_ / diagonal_; }
  std::optional<double> turned() const {
    return lying_.empty() ? std::nullopt : std::optional(degreesOf(rigidOf(lying_.back()).linear()));
  }
  std::uint32_t compared() const { return std::uint32_t(vertices_.size()); }
  const std::vector<Vector3f>& shape() const { return reference_.frames[widest_]; }
  std::optional<double> frequency() const { return swing_ ? std::optional(swing_->frequency) : std::nullopt; }
  std::vector<double> areas() const {
    std::vector<double> result(body_.surface.size(), 0);
    for (const std::uint32_t v : vertices_) result[v] = body_.areas[v];
    return result;
  }

  void judge(Motion motion, ErrorRow& row) const {
    row.lost = !motion.finite || motion.frames.size() < reference_.frames.size();
    if (row.lost) return;
    if (!lying_.empty()) {
      row.astray = apart(motion.frames, lying_);
      row.lost = !(*row.astray * rms_ < kLost * diagonal_);
      if (row.lost) return;
      row.turned = degreesOf(rigidOf(lying_.back()).linear().transpose() * rigidOf(motion.frames.back()).linear());
      motion = withoutRigid(std::move(motion));
    }
    row.shape = motion.frames[widest_];
    double square = 0, weight = 0, furthest = 0;
    for (std::size_t frame = first_; frame < reference_.frames.size(); ++frame) {
      for (const std::uint32_t v : vertices_) {
        const double off = double((motion.frames[frame][v] - reference_.frames[frame][v]).norm());
        square += body_.areas[v] * off * off;
        furthest = std::max(furthest, off);
      }
      weight += area_;
    }
    row.lost = !(furthest < kLost * diagonal_);
    row.path = std::sqrt(square / weight) / rms_;
    row.largest = furthest / largest_;
    const std::vector<Vector3d> end = meanOfEnd(motion);
    double off = 0;
    for (const std::uint32_t v : vertices_) off += body_.areas[v] * (end[v] - end_[v]).squaredNorm();
    // A body let go swings about its rest: its end is measured by how far it went.
    row.end = std::sqrt(off / area_) / std::max(end_rms_, swing_ ? rms_ : 0);
    if (!triangles_.empty()) {
      for (std::size_t frame = first_; frame < reference_.frames.size(); ++frame) {
        row.volume = std::max(row.volume,
                              std::abs(volumeOf(motion.frames[frame]) - volumeOf(reference_.frames[frame])) / volume_);
      }
    }
    if (!swing_) return;
    if (const std::optional<Swing> swing = swingOf(motion)) {
      row.frequency = swing->frequency / swing_->frequency;
      row.decay = swing->decay / swing_->decay;
    }
  }

  // Judged by this reference's means: rms difference of two paths.
  double apart(const Motion& one, const Motion& other) const {
    if (lying_.empty()) return apart(one.frames, other.frames);
    return apart(withoutRigid(one).frames, withoutRigid(other).frames);
  }

 private:
  static constexpr double kEndSeconds = 0.25;
  static constexpr double kLost = 10;  // diagonals
  struct Swing {
    double frequency, decay;  // Hz, 1/s
  };

  using Frames = std::vector<std::vector<Vector3f>>;

  double apart(const Frames& one, const Frames& other) const {
    double square = 0, weight = 0;
    for (std::size_t frame = first_; frame < std::min(one.size(), other.size()); ++frame) {
      for (const std::uint32_t v : vertices_) {
        square += body_.areas[v] * double((one[frame][v] - other[frame][v]).squaredNorm());
      }
      weight += area_;
    }
    return std::sqrt(square / weight) / rms_;
  }

  static double degreesOf(const Eigen::Matrix3d& turn) {
    return Eigen::AngleAxisd(turn).angle() * 180 / std::numbers::pi;
  }

  float lowest(const std::vector<Vector3f>& frame) const {
    float low = frame[vertices_.front()][1];
    for (const std::uint32_t v : vertices_) low = std::min(low, frame[v][1]);
    return low;
  }

  // The rigid motion that takes the rest shape to a frame and leaves the least, by area (Kabsch 1976).
  Eigen::Isometry3d rigidOf(const std::vector<Vector3f>& frame) const {
    Vector3d rest_centre = Vector3d::Zero(), centre = Vector3d::Zero();
    for (const std::uint32_t v : vertices_) {
      rest_centre += body_.areas[v] / area_ * body_.surface[v];
      centre += body_.areas[v] / area_ * frame[v].cast<double>();
    }
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    for (const std::uint32_t v : vertices_) {
      moment += body_.areas[v] * (frame[v].cast<double>() - centre) * (body_.surface[v] - rest_centre).transpose();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Vector3d sign = Vector3d::Ones();
    sign[2] = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    Eigen::Isometry3d rigid = Eigen::Isometry3d::Identity();
    rigid.linear() = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
    rigid.translation() = centre - rigid.linear() * rest_centre;
    return rigid;
  }

  Motion withoutRigid(Motion motion) const {
    for (std::vector<Vector3f>& frame : motion.frames) {
      const Eigen::Isometry3d back = rigidOf(frame).inverse();
      for (Vector3f& x : frame) x = (back * x.cast<double>()).cast<float>();
    }
    return motion;
  }

  std::vector<Vector3d> meanOfEnd(const Motion& motion) const {
    const auto frames = std::size_t(std::lround(kEndSeconds / kFrameSeconds));
    std::vector<Vector3d> mean(body_.surface.size(), Vector3d::Zero());
    for (std::size_t frame = motion.frames.size() - frames; frame < motion.frames.size(); ++frame) {
      for (const std::uint32_t v : vertices_) mean[v] += motion.frames[frame][v].cast<double>() / double(frames);
    }
    return mean;
  }

  // Part of the way that it had when it was let go, by its crossings of zero and its extremes between them.
  std::optional<Swing> swingOf(const Motion& motion) const {
    std::vector<double> s;
    double norm = 0;
    for (const std::uint32_t v : vertices_)
      norm += body_.areas[v] * (before_[v].cast<double>() - body_.surface[v]).squaredNorm();
    for (std::size_t frame = first_; frame < motion.frames.size(); ++frame) {
      double sum = 0;
      for (const std::uint32_t v : vertices_) {
        sum += body_.areas[v] * (motion.frames[frame][v].cast<double>() - body_.surface[v])
                                    .dot(before_[v].cast<double>() - body_.surface[v]);
      }
      s.push_back(sum / norm);
    }
    std::vector<double> crossings;
    std::vector<std::pair<double, double>> extremes;  // time, log of the size
    double most = 0, when = 0;
    for (std::size_t i = 1; i < s.size(); ++i) {
      if (std::abs(s[i]) > most) {
        most = std::abs(s[i]);
        when = double(i);
      }
      if ((s[i - 1] > 0) == (s[i] > 0)) continue;
      crossings.push_back(double(i) - s[i] / (s[i] - s[i - 1]));
      if (crossings.size() > 1 && most > 1e-3) extremes.emplace_back(when * kFrameSeconds, std::log(most));
      most = 0;
    }
    if (crossings.size() < 3 || extremes.size() < 2) return {};
    const double halves = double(crossings.size() - 1);
    const double time = (crossings.back() - crossings.front()) * kFrameSeconds;
    double t = 0, y = 0, tt = 0, ty = 0;
    for (const auto& [at, size] : extremes) {
      t += at, y += size, tt += at * at, ty += at * size;
    }
    const auto n = double(extremes.size());
    return Swing{0.5 * halves / time, -(n * ty - t * y) / (n * tt - t * t)};
  }

  void setTriangles(const formats::PackageView& package) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> open;
    std::map<std::array<float, 3>, std::uint32_t> places;  // vertices that were split at seams are one
    const auto place = [&](std::uint32_t v) {
      return places.try_emplace(package.visualPositions()[v], v).first->second;
    };
    for (const auto& c : package.visualTriangles()) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = place(c[k]), b = place(c[(k + 1) % 3]);
        open[std::minmax(a, b)] += a < b ? 1 : -1;
      }
    }
    if (std::any_of(open.begin(), open.end(), [](const auto& edge) { return edge.second != 0; })) return;
    for (const auto& c : package.visualTriangles()) triangles_.push_back({c[0], c[1], c[2]});
    std::vector<Vector3f> rest;
    for (const Vector3d& x : body_.surface) rest.push_back(x.cast<float>());
    volume_ = volumeOf(rest);
    if (!(volume_ > 0)) triangles_.clear();
  }
  double volumeOf(const std::vector<Vector3f>& x) const {
    double six = 0;
    for (const auto& c : triangles_) {
      six += x[c[0]].cast<double>().dot(x[c[1]].cast<double>().cross(x[c[2]].cast<double>()));
    }
    return six / 6;
  }

  const MotionBody& body_;
  Motion reference_;
  std::size_t first_, widest_ = 0;
  double diagonal_;
  std::vector<std::uint32_t> vertices_;
  double area_ = 0, rms_ = 0, largest_ = 0, end_rms_ = 0, volume_ = 0;
  std::vector<Vector3d> end_;
  std::vector<Vector3f> before_;
  Frames lying_;  // of what is not held: the reference as it lies
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::optional<Swing> swing_;
};

}  // namespace sinew::tools
