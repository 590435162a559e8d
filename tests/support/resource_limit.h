// A limit of the process that goes with its scope.
#pragma once

#include <sys/resource.h>

namespace raydix::test {

class ResourceLimit {
public:
    using Resource = decltype(RLIMIT_AS);

    /// `resource`: RLIMIT_FSIZE, RLIMIT_AS, ...
    ResourceLimit(Resource resource, rlim_t most) : resource_(resource) {
        getrlimit(resource, &before_);
        const rlimit now{most, before_.rlim_max};
        setrlimit(resource, &now);
    }
    ~ResourceLimit() { setrlimit(resource_, &before_); }
    ResourceLimit(const ResourceLimit&) = delete;
    ResourceLimit& operator=(const ResourceLimit&) = delete;

private:
    Resource resource_;
    rlimit before_{};
};

}  // namespace raydix::test
