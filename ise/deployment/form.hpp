#pragma once
#include <ise/core/time.hpp>
#include <ise/deployment/value.hpp>

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace ise::deployment {

/// Reads the keys of one table: each that is known by its function, the others are told with the nearest known one.
class form {
public:
    /// `of` is whose keys they are, for messages: "component 'air'".
    form(std::string of, std::vector<problem>& problems) : of_(std::move(of)), problems_(problems) {}

    using reader = std::function<void(const entry&)>;
    form& key(std::string name, reader read);
    form& text(std::string name, std::string& into);
    form& texts(std::string name, std::vector<value>& into); ///< one, or an array of them
    form& length(std::string name, duration& into);
    form& count(std::string name, std::uint32_t& into, std::int64_t most);
    /// Reads a table; tells what is none.
    void read(const value& from) const;

    void wrong(const place& at, std::string what) const;
    /// "'after' of component 'air' is a text, not a number"
    void wrong_kind(const entry& which, std::string_view wanted) const;

private:
    std::string of_;
    std::vector<problem>& problems_;
    std::vector<std::pair<std::string, reader>> keys_;
};

} // namespace ise::deployment
