#pragma once
#include <ise/core/result.hpp>
#include <ise/name_server/secret_hash.hpp>
#include <ise/naming/services.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace ise {

struct schema_store_limits {
    std::size_t max_schemas = 200'000;
    std::size_t max_schema_bytes = 64 * 1024; ///< one text
    std::size_t max_schema_total_bytes = std::size_t{256} << 20;
};

/// The texts of schemas that registered services name: each once, however many components use it, for as long as one
/// does. A text is kept under the fingerprint that it has, not under the one that it is said to have.
class schema_store {
public:
    schema_store(schema_store_limits limits, const secret_hash& hash) : limits_(limits), texts_(0, hash) {}

    /// Keeps a text until its uses are released; one that nobody uses yet goes with the next `sweep()`.
    /// errc::malformed: no schema, or that of another fingerprint; errc::too_large.
    result<void> offer(const naming::schema_text& given);
    void use(const std::vector<naming::service_entry>& services);
    void release(const std::vector<naming::service_entry>& services);
    /// Forgets what was offered and is used by nobody.
    void sweep();

    /// Appends those that `services` name, each once.
    void collect(const std::vector<naming::service_entry>& services, std::vector<naming::schema_text>& into) const;
    std::size_t size() const noexcept { return texts_.size(); }

private:
    struct entry {
        std::string text; // empty: it was not told
        std::size_t uses = 0;
    };
    void erase(by_number<entry>::iterator which);

    schema_store_limits limits_;
    by_number<entry> texts_; // by fingerprint
    std::vector<std::uint64_t> offered_;
    std::size_t total_bytes_ = 0;
    std::size_t told_ = 0; // that have a text
};

} // namespace ise
