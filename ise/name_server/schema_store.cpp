#include <ise/name_server/schema_store.hpp>

#include <ise/packet/schema.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace ise {

result<void> schema_store::offer(const naming::schema_text& given) {
    auto known = texts_.find(given.fingerprint);
    if (known != texts_.end() && !known->second.text.empty()) return {};
    if (given.text.size() > limits_.max_schema_bytes)
        return failure(errc::too_large, fmt::format("a schema of {} bytes, max_schema_bytes is {}", given.text.size(),
                                                    limits_.max_schema_bytes));
    if (told_ >= limits_.max_schemas)
        return failure(errc::too_large, fmt::format("there are {} schemas already, which is max_schemas", told_));
    if (total_bytes_ + given.text.size() > limits_.max_schema_total_bytes)
        return failure(errc::too_large, fmt::format("all schemas have {} bytes already, max_schema_total_bytes is {}",
                                                    total_bytes_, limits_.max_schema_total_bytes));
    auto parsed = schema::parse(given.text);
    if (!parsed) return parsed.error();
    if (parsed->fingerprint() != given.fingerprint)
        return failure(errc::malformed,
                       fmt::format("the schema of '{}' has the fingerprint {:016x}, it was sent as {:016x}",
                                   parsed->name(), parsed->fingerprint(), given.fingerprint));
    total_bytes_ += given.text.size();
    ++told_;
    texts_[given.fingerprint].text = given.text;
    offered_.push_back(given.fingerprint);
    return {};
}

void schema_store::use(const std::vector<naming::service_entry>& services) {
    for (const auto& service : services)
        for (auto fingerprint : service.fingerprints) ++texts_[fingerprint].uses;
}

void schema_store::release(const std::vector<naming::service_entry>& services) {
    for (const auto& service : services)
        for (auto fingerprint : service.fingerprints)
            if (auto found = texts_.find(fingerprint); found != texts_.end() && --found->second.uses == 0) erase(found);
}

void schema_store::erase(by_number<entry>::iterator which) {
    total_bytes_ -= which->second.text.size();
    told_ -= !which->second.text.empty();
    texts_.erase(which);
}

void schema_store::sweep() {
    for (auto fingerprint : std::exchange(offered_, {})) {
        auto found = texts_.find(fingerprint);
        if (found != texts_.end() && found->second.uses == 0) erase(found);
    }
}

void schema_store::collect(const std::vector<naming::service_entry>& services,
                           std::vector<naming::schema_text>& into) const {
    std::set<std::uint64_t> result;
    for (const auto& service : services)
        for (auto fingerprint : service.fingerprints) {
            auto found = texts_.find(fingerprint);
            if (found == texts_.end() || found->second.text.empty() || !result.insert(fingerprint).second) continue;
            naming::schema_text text;
            text.fingerprint = fingerprint;
            text.text = found->second.text;
            into.push_back(std::move(text));
        }
}

} // namespace ise
