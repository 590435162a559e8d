// Memory that a thread keeps from call to call.
#pragma once

#include <memory>

namespace raydix {

/// This thread's own T while the call lasts. What a call leaves in it, the next one finds. A call
/// that comes from within another one's, by way of the caller's functions, is given a new T.
template <class T>
class ThreadOwn {
public:
    ThreadOwn() {
        Kept& kept = kept_here();
        if (!kept.taken) {
            kept.taken = true;
            own_ = &kept.own;
        } else {
            inner_ = std::make_unique<T>();
            own_ = inner_.get();
        }
    }
    ~ThreadOwn() {
        if (inner_ == nullptr) kept_here().taken = false;
    }
    ThreadOwn(const ThreadOwn&) = delete;
    ThreadOwn& operator=(const ThreadOwn&) = delete;

    T& operator*() const { return *own_; }
    T* operator->() const { return own_; }

private:
    struct Kept {
        T own;
        bool taken = false;
    };
    static Kept& kept_here() {
        thread_local Kept kept;
        return kept;
    }

    T* own_;
    std::unique_ptr<T> inner_;
};

}  // namespace raydix
