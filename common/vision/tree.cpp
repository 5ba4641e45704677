// tree.cpp - cv::FileStorage's tree, flattened (tree.h).
#include "tree.h"

#include <cctype>
#include <cstring>
#include <string>
#include <vector>

#include "guard.hpp"

namespace
{

struct leaf {
    std::string path, words;
    std::vector<double> numbers;
};

// FileStorage's JSON knows no null, and no empty list or map: such members say nothing, and become empty
// words.
std::string without_null(const std::string &s)
{
    std::string out;
    out.reserve(s.size() + 64);
    bool quoted = false;
    for (size_t i = 0; i < s.size(); i++) {
        if (s[i] == '"') quoted = !quoted;
        if (quoted && s[i] == '\\' && i + 1 < s.size()) {
            out += s[i++];
        } else if (!quoted && s.compare(i, 4, "null") == 0) {
            out += "\"\"";
            i += 3;
            continue;
        } else if (!quoted && i > 0 && (s[i] == '[' || s[i] == '{')) {
            size_t k = i + 1;
            while (k < s.size() && std::isspace(static_cast<unsigned char>(s[k]))) k++;
            if (k < s.size() && s[k] == (s[i] == '[' ? ']' : '}')) {
                out += "\"\"";
                i = k;
                continue;
            }
        }
        out += s[i];
    }
    return out;
}

// FileStorage wants a list's lines further in than the key that they belong to, and flow lists on lines
// further in than that; YAML allows both at the key's own column, and Kalibr writes so.
std::string indented_lists(const std::string &s)
{
    std::string out;
    out.reserve(s.size() + 256);
    int depth = 0;
    char quote = 0;
    bool start = true;
    for (size_t i = 0; i < s.size(); i++) {
        char c = s[i];
        if (start && depth == 0) {
            size_t k = s.find_first_not_of(' ', i);
            if (k != std::string::npos && s.compare(k, 2, "- ") == 0) out += "  ";
            start = false;
        }
        if (quote) {
            if (c == '\\' && quote == '"' && i + 1 < s.size()) out += s[i++], c = s[i];
            else if (c == quote || c == '\n') quote = 0;
        } else if (c == '#' && (i == 0 || std::isspace(static_cast<unsigned char>(s[i - 1])))) {
            while (i < s.size() && s[i] != '\n') i++; // a comment
            c = '\n';
        } else if (c == '"' || (c == '\'' && i > 0 && std::isspace(static_cast<unsigned char>(s[i - 1])))) {
            quote = c;
        } else if (c == '[' || c == '{') {
            depth++;
        } else if ((c == ']' || c == '}') && depth > 0) {
            depth--;
        }
        if (c == '\n' || c == '\r') {
            out += depth > 0 || c == '\r' ? ' ' : c;
            start = c == '\n';
            continue;
        }
        out += c;
    }
    return out;
}

// All that a list holds, if it is numbers, and lists of such, alone.
bool all_numbers(std::vector<double> &v, const cv::FileNode &n, int depth)
{
    if (depth > 8) return false;
    for (const cv::FileNode &q : n) {
        if (q.isInt() || q.isReal()) v.push_back(q.real());
        else if (!q.isSeq() || !all_numbers(v, q, depth + 1)) return false;
    }
    return true;
}

void walk(std::vector<leaf> &out, const cv::FileNode &n, const std::string &path, int depth)
{
    if (depth > 32) CV_Error(cv::Error::StsOutOfRange, "more than 32 levels");
    leaf l{path, "", {}};
    if (n.isInt() || n.isReal()) {
        l.numbers.push_back(n.real());
    } else if (n.isString()) {
        l.words = n.string();
    } else if (n.isSeq()) {
        if (!all_numbers(l.numbers, n, 0)) {
            int k = 0;
            for (const cv::FileNode &q : n) walk(out, q, path + "." + std::to_string(k++), depth + 1);
            return;
        }
    } else if (n.isMap()) {
        for (const cv::FileNode &q : n)
            walk(out, q, path.empty() ? q.name() : path + "." + q.name(), depth + 1);
        return;
    } else {
        return;
    }
    out.push_back(std::move(l));
}

} // namespace

struct vision_tree {
    std::vector<leaf> leaves;
    const leaf *find(const char *path) const
    {
        for (const leaf &l : leaves)
            if (l.path == path) return &l;
        return nullptr;
    }
};

int vision_tree_read(vision_tree **t, const char *text, const char *name, errmsg *e)
{
    return vision::guarded(e, name, [&]() -> int {
        std::string s(text);
        if (s.compare(0, 3, "\xef\xbb\xbf") == 0) s.erase(0, 3);
        size_t at = 0;
        while (at < s.size() && std::isspace(static_cast<unsigned char>(s[at]))) at++;
        s.erase(0, at);
        if (s.empty()) return err_set(e, "%s: expected a calibration, found nothing", name);
        if (s[0] != '{' && s[0] != '<') {
            bool headed = s.compare(0, 5, "%YAML") == 0, ruled = s.compare(0, 3, "---") == 0;
            s = (headed ? "" : ruled ? "%YAML:1.0\n" : "%YAML:1.0\n---\n") + indented_lists(s);
        }
        if (s[0] == '{') s = without_null(s);
        // what cannot be parsed is told in one line of ours, not in OpenCV's log
        cv::ErrorCallback old =
            cv::redirectError([](int, const char *, const char *, const char *, int, void *) { return 0; });
        struct back {
            cv::ErrorCallback f;
            ~back()
            {
                cv::redirectError(f);
            }
        } restore{old};
        cv::FileStorage f(s, cv::FileStorage::READ | cv::FileStorage::MEMORY);
        if (!f.isOpened()) return err_set(e, "%s: expected YAML, JSON or XML, found something else", name);
        vision_tree *made = new vision_tree;
        try {
            walk(made->leaves, f.root(), "", 0);
        } catch (...) {
            delete made;
            throw;
        }
        *t = made;
        return 0;
    });
}

void vision_tree_free(vision_tree *t)
{
    delete t;
}

int vision_tree_count(const vision_tree *t)
{
    return static_cast<int>(t->leaves.size());
}

const char *vision_tree_path(const vision_tree *t, int k)
{
    return k >= 0 && k < vision_tree_count(t) ? t->leaves[static_cast<size_t>(k)].path.c_str() : nullptr;
}

const double *vision_tree_numbers(const vision_tree *t, const char *path, int *n)
{
    const leaf *l = t->find(path);
    *n = l ? static_cast<int>(l->numbers.size()) : 0;
    return *n ? l->numbers.data() : nullptr;
}

const char *vision_tree_words(const vision_tree *t, const char *path)
{
    const leaf *l = t->find(path);
    return l && l->numbers.empty() ? l->words.c_str() : nullptr;
}
