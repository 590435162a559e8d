// Memory of things that are made again and again: of one that nobody holds any more it goes to the
// next, whose pages and caches are then those of before.
#pragma once

#include <memory>
#include <mutex>
#include <utility>

namespace raydix {

/// Keeps one thing at most. Any number of threads may use it at once; copies share what is kept.
template <class T>
class Recycler {
public:
    /// What was given back last, with what is in it, or null.
    [[nodiscard]] std::unique_ptr<T> take() {
        const std::scoped_lock lock(spare_->mutex);
        return std::move(spare_->kept);
    }
    void give(std::unique_ptr<T> used) {
        const std::scoped_lock lock(spare_->mutex);
        spare_->kept.swap(used);
    }
    /// The last one who holds it gives it back, on any thread, also after the recycler's end.
    [[nodiscard]] std::shared_ptr<const T> share(std::unique_ptr<T> made) {
        return {made.release(),
                [recycler = *this](T* used) mutable { recycler.give(std::unique_ptr<T>(used)); }};
    }

private:
    struct Spare {
        std::mutex mutex;
        std::unique_ptr<T> kept;
    };
    std::shared_ptr<Spare> spare_ = std::make_shared<Spare>();
};

}  // namespace raydix
