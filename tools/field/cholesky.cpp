// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/cholesky.h"

#include <cholmod.h>

#include <mutex>
#include <new>
#include <stdexcept>

// There where the machine's BLAS is OpenBLAS.
extern "C" {
[[gnu::weak]] int openblas_get_parallel();
[[gnu::weak]] void openblas_set_num_threads(int count);
}

namespace sinew::tools::field {
namespace {

// What CHOLMOD works in; threads do not share it.
class Workspace {
 public:
  Workspace() {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.print = 0;  // a matrix that is not positive definite is an answer
  }
  ~Workspace() { cholmod_finish(&common_); }
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;
  cholmod_common* get() { return &common_; }

 private:
  cholmod_common common_{};
};

// For as long as CHOLMOD uses the BLAS. An OpenBLAS that was built without threads may not be called by two at a time.
std::unique_lock<std::mutex> blasLock() {
  static std::mutex mutex;
  const bool alone = openblas_get_parallel != nullptr && openblas_get_parallel() == 0;
  return alone ? std::unique_lock(mutex) : std::unique_lock<std::mutex>();
}

cholmod_sparse viewOf(const Eigen::SparseMatrix<double>& lower) {
  cholmod_sparse view{};
  view.nrow = view.ncol = std::size_t(lower.rows());
  view.nzmax = std::size_t(lower.nonZeros());
  // CHOLMOD reads them only.
  view.p = const_cast<int*>(lower.outerIndexPtr());
  view.i = const_cast<int*>(lower.innerIndexPtr());
  view.x = const_cast<double*>(lower.valuePtr());
  view.stype = -1;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = view.packed = 1;
  return view;
}

}  // namespace

struct Cholesky::Factor {
  ~Factor() { cholmod_free_factor(&factor, workspace.get()); }
  Workspace workspace;
  cholmod_factor* factor = nullptr;
};

Cholesky::Cholesky(const Eigen::SparseMatrix<double>& lower) : factor_(std::make_unique<Factor>()) {
  // Fronts are small: threads of the BLAS cost more than they save.
  if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
  cholmod_sparse view = viewOf(lower);
  factor_->factor = cholmod_analyze(&view, factor_->workspace.get());
  if (factor_->factor == nullptr) throw std::bad_alloc();
}

Cholesky::~Cholesky() = default;

bool Cholesky::factorize(const Eigen::SparseMatrix<double>& lower) {
  cholmod_sparse view = viewOf(lower);
  const auto lock = blasLock();
  cholmod_factorize(&view, factor_->factor, factor_->workspace.get());
  const int status = factor_->workspace.get()->status;
  if (status < CHOLMOD_OK) throw std::bad_alloc();
  return status == CHOLMOD_OK;
}

Eigen::MatrixXd Cholesky::solve(const Eigen::MatrixXd& right) const {
  if (right.size() == 0) return right;
  Workspace workspace;
  cholmod_dense view{};
  view.nrow = view.d = std::size_t(right.rows());
  view.ncol = std::size_t(right.cols());
  view.nzmax = std::size_t(right.size());
  view.x = const_cast<double*>(right.data());
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* found = nullptr;
  {
    const auto lock = blasLock();
    found = cholmod_solve(CHOLMOD_A, factor_->factor, &view, workspace.get());
  }
  if (found == nullptr) throw std::bad_alloc();
  Eigen::MatrixXd result = Eigen::MatrixXd::Map(static_cast<const double*>(found->x), right.rows(), right.cols());
  cholmod_free_dense(&found, workspace.get());
  return result;
}

std::unique_ptr<Cholesky> firmFactor(Eigen::SparseMatrix<double>& lower) {
  auto factor = std::make_unique<Cholesky>(lower);
  const Eigen::VectorXd diagonal = lower.diagonal();
  for (double extra = 1e-13; !factor->factorize(lower); extra *= 100) {
    if (!(extra < 1)) throw std::logic_error("a stiffness is not finite");
    lower.diagonal() = (1 + extra) * diagonal;
  }
  return factor;
}

}  // namespace sinew::tools::field
