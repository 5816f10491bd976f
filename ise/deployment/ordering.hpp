#pragma once
#include <ise/deployment/deployment.hpp>

#include <cstddef>
#include <vector>

namespace ise::deployment {

/// The components of a deployment, by number, in the order in which they are started.
struct ordering {
    std::vector<std::size_t> order;               ///< all of them, or those before a circle
    std::vector<problem> problems;                ///< circles of components that name each other
    std::vector<std::vector<std::size_t>> before; ///< of each component those that it comes right after
};

/// `types` are those of the components; null where the type is not known. A component comes after those that it names;
/// one that names nobody comes after those of other types that provide what it requires, unless they come after it
/// already: of two that require each other, the later one in the file is started first. Else the order is the file's.
ordering order_of(const deployment& of, const std::vector<const type_info*>& types);

} // namespace ise::deployment
