#pragma once
#include <cstddef>
#include <memory>
#include <string>

namespace ise::cli {

/// A terminal that shows one page after the other, on its alternate screen, and whose keys are read one by one. As it
/// was again when this is destroyed, however the command ends. Where standard output is no terminal nothing is done.
class screen {
public:
    screen();
    ~screen();
    screen(const screen&) = delete;
    screen& operator=(const screen&) = delete;

    bool live() const noexcept { return live_; }
    /// Lines of the terminal; 0 where there is none.
    std::size_t height() const;
    /// The page with what puts it in the place of the one before; no more lines than there are, none longer than
    /// `width`.
    std::string page(std::string text, std::size_t width) const;
    /// Whether q was pressed since the last look.
    bool quit() const;

private:
    struct keyboard;
    bool live_ = false;
    std::unique_ptr<keyboard> keys_;
};

} // namespace ise::cli
