#include <ise/deployment/including.hpp>

#include <ise/deployment/toml.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace ise::deployment {
namespace {

constexpr std::size_t deepest = 16;
constexpr std::size_t max_files = 64;

std::string beside(const std::string& file, const std::string& other) {
    auto slash = file.rfind('/');
    return other.starts_with('/') || slash == std::string::npos ? other : file.substr(0, slash + 1) + other;
}

class loader {
public:
    loader(const file_reader& read, std::vector<problem>& problems) : read_(read), problems_(problems) {}

    value load(const std::string& file, const place& from) {
        if (std::ranges::find(open_, file) != open_.end()) {
            auto circle = open_;
            circle.push_back(file);
            return fail(from, fmt::format("files include each other: {}", fmt::join(circle, " includes ")));
        }
        if (open_.size() >= deepest || ++count_ > max_files)
            return fail(from, fmt::format("more than {} files one in the other, or {} in all", deepest, max_files));
        auto text = read_(file);
        if (!text) return fail(from, text.error().message());
        open_.push_back(file);
        auto own = parse_toml(*text, file, problems_);
        auto made = value();
        made.at = own.at;
        if (const auto* include = own.find("include"))
            for (const auto& one : names_in(include->what))
                made = laid_over(std::move(made), load(beside(file, one.text), one.at));
        std::erase_if(own.entries, [](const entry& one) { return one.key == "include"; });
        open_.pop_back();
        return laid_over(std::move(made), std::move(own));
    }

private:
    std::vector<value> names_in(const value& what) {
        auto all = what.is == value::kind::array ? what.items : std::vector<value>{what};
        for (const auto& one : all)
            if (one.is != value::kind::text)
                problems_.push_back({one.at, fmt::format("'include' names files: a text or an array of texts, not {}",
                                                         one.kind_name())});
        std::erase_if(all, [](const value& one) { return one.is != value::kind::text; });
        return all;
    }
    value fail(const place& at, std::string what) {
        problems_.push_back({at, std::move(what)});
        return {};
    }

    const file_reader& read_;
    std::vector<problem>& problems_;
    std::vector<std::string> open_;
    std::size_t count_ = 0;
};

} // namespace

value load(const std::string& file, const file_reader& read, std::vector<problem>& problems) {
    return loader(read, problems).load(file, place{file, 0, 0});
}

} // namespace ise::deployment
